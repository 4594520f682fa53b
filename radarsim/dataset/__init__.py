"""Data sets: many recordings from one specification, on local processes or a Ray cluster; `run` is the way in."""

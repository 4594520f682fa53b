"""Data sets of many recordings from one specification, made by local processes or on a Ray cluster (`run`)."""

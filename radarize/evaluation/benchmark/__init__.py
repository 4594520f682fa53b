"""Benchmarks of methods on folders of recordings: the paper's tables, maps, multipath, ablations.

`registry` lists all benchmarks, `study` defines a benchmark and runs it.
"""

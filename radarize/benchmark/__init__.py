"""Comparisons of methods on folders of recordings: the paper's tables, maps, multipath, ablations.

Start reading at `radarize.benchmark.benchmark`: what a comparison is, and how one is carried out.
"""

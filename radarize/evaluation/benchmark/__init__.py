"""Comparisons of methods on folders of recordings: the paper's tables, maps, multipath, ablations.

Start reading at `registry`, all of them, and `study`: what one is, and how it is carried out.
"""

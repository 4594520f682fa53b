"""Reports of recordings, runs and comparisons: self-contained HTML pages, and tables in the terminal.

`Page` collects the content of a page, ``templates`` define its layout, `plots` and `drawings` draw its figures.
"""

"""What is shown of recordings, runs and comparisons: pages that open without a network, and tables in the terminal.

`Page` holds what a page is made of, ``templates`` what it looks like; `plots` and `drawings` draw what stands in it.
"""

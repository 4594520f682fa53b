"""Physical laws: each a function that draws theory and simulation on an axis, and returns their difference in words.

Its docstring is the law. `benchmarks.physics_gallery` makes a page of them.
"""

"""Physical laws: each a function that draws theory and simulation on an axis, and says how far they are apart.

Its docstring says the law. `benchmarks.physics_gallery` makes a page of them.
"""

"""Physical laws: functions that plot theory and simulation on an axis, and return the error of the simulation as text.

The docstring of a function states the law. `benchmarks.physics_gallery` makes a page of them.
"""

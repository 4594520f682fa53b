"""The twin of a recording: the same walk simulated in a model of its place, and how alike the two are."""

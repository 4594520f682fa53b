"""Digital twin of a recording: the same walk simulated in a model of its place, and a comparison of the two."""

"""Signal processing of raw I/Q: `batch` (frames with cached products), spectra and heat maps, point clouds, disturbed
chirps, broken receivers, aliased speeds."""

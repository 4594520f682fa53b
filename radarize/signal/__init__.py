"""Signal processing of raw I/Q: `batch` (frames, and what is made of them once), spectra and heat maps, point clouds,
disturbed chirps, broken receivers, aliased speeds."""

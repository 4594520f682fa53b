"""Files and recordings: safe readers of foreign files, `recording` (HDF5), `importers` and `exporters` (other formats),
`load`; errors, plain data, poses and trajectories, progress on the terminal, parallel jobs and plug-ins."""

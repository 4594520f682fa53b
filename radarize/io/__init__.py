"""Files and recordings: guarded openers of what comes from elsewhere, `recording` (HDF5), `importers` and `exporters`
(foreign formats), `load`; errors, plain data, poses and trajectories, progress on the terminal, jobs and plug-ins."""

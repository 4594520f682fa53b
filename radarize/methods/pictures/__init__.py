"""Points like a lidar's from polar pictures (`radarize.polar`), by a network that learns from simulation alone."""

TASKS = {"pictures": "radarize.methods.pictures.training:Pictures"}

"""Motion of the sensor and of people: trajectories, planner, platforms."""

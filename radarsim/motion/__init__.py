"""How the sensor and people move: trajectories, planner, platforms."""

"""Points like a lidar's, and turns, from RadarHD's pictures (`radarize.signal.polar`), by networks of simulation."""

"""Networks on RadarHD's pictures (`radarize.signal.polar`), trained in simulation: point clouds and changes of yaw."""

"""Receiver model from propagation paths to samples: synthesis, front end, phase noise, interference, calibration."""

"""Recordings made of scenarios: batches of frames by processes, resume, sensors added later."""

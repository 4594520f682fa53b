"""Simulated recordings: batches of frames by several processes, resume, sensors added later."""

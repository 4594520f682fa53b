"""Doppler RANSAC over sparse points (Doer and Trommer, REVE, 2020), with the turns of `doppler`."""

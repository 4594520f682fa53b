"""Realism of simulated walks: real and simulated pictures, their statistics, and a network that classifies them."""

"""How like real walks simulated ones are: pictures of either, their statistics, and a network that tells them apart."""

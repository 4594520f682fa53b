"""Propagation: every path from transmitter to receiver, with its length, amplitude and type."""

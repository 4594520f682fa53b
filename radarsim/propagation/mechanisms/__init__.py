"""Propagation mechanisms, one per file."""

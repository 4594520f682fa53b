"""Generators of buildings and furniture."""

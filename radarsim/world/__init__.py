"""Scenes: materials, objects, movers, ray tests, building generators, importers."""

"""The scene: materials, objects, movers, ray tests, generators of buildings, importers."""

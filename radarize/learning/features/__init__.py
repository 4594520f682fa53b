"""Input of networks: maps of a frame, windows of a stream, tables of whole recordings."""

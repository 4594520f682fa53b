"""What networks see: maps of a frame, windows of a stream, tables of whole recordings."""

"""What networks are made of, and the files that their weights are kept in."""

"""A method and a file format of one's own."""

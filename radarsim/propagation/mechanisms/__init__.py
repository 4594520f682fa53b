"""Ways in which an echo comes about, one per file."""

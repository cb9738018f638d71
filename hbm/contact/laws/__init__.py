"""Contact laws, one file each, found by name."""

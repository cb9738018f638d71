"""Wear laws, one file each, found by name."""

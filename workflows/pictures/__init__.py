"""Curves, maps and renders of a result."""

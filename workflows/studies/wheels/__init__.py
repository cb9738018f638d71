"""Wheels: modes, flutter, and sectors that differ."""

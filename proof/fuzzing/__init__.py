"""Damage to all input, and how the runs end."""

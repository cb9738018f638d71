"""Measurements: read them and compare them with what a scene computes."""

"""Brake-Reuss beam: the measured benchmark of the joints community."""

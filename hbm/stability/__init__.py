"""Stability of periodic motions by Hill's method and by integration; chattering contacts."""

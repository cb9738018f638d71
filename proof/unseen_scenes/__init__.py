"""Stated errors of scenes drawn at random."""

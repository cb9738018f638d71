"""Time integration of the reduced model, and harmonic balance held against it."""

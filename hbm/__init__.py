"""Reduced model -> response: harmonic balance with friction contact, continuation, wear."""

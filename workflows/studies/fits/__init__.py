"""Numbers of a scene fitted to measured ones, and what these leave open."""

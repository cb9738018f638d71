"""Turbine wheel as it is built: dovetail roots, underplatform dampers and tip shrouds at once."""

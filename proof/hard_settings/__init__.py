"""The solver at its numerical extremes."""

"""Vane on a stop: a demonstration in numbers of practice, micrometres, millijoules and megapascals."""

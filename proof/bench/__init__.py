"""A bench for vibration with friction and contact: problems and results as text files, see README.md."""

"""The command `tribodyn`."""

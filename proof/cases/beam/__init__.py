"""Cantilever on a contact patch: Tamatam 2021, sections 4.2 and 7.6."""

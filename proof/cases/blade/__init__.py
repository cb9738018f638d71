"""Shrouded bladed disk: Tamatam 2021, section 4.3."""

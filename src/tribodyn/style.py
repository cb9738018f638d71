"""Colours, colour maps and fonts that all pictures share, for figures of one's own beside them."""

from tribodyn.workflows.pictures.theme import BLUE, GREEN, GREY, INK, ORANGE, PRESSURE_MAP, RED, STATUS, STYLE, WEAR_MAP

__all__ = ["BLUE", "GREEN", "GREY", "INK", "ORANGE", "PRESSURE_MAP", "RED", "STATUS", "STYLE", "WEAR_MAP"]

"""What a command of one's own shares with `tribodyn`: common options, quantities with units, room for its output."""

from tribodyn.workflows.command.words import (
    Changes,
    Flag,
    Json,
    Overrides,
    aside,
    make_room,
    print_lines,
    quantity,
)

__all__ = ["Changes", "Flag", "Json", "Overrides", "aside", "make_room", "print_lines", "quantity"]

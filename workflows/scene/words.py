"""Sentences about keys of a scene that do not exist."""

from __future__ import annotations

import difflib


def unknown_key(key: str, known: list[str]) -> str:
    """Clause about a key that does not exist, with the one that was probably meant and all that exist."""
    names = [name for name in known if name != "parameters"]
    close = difflib.get_close_matches(key.rpartition(".")[2], names, n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    return f"unknown key {key}{hint}, known here: {', '.join(names)}"

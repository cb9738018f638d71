"""The text of an Abaqus or CalculiX deck as a list of cards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Card:
    """One keyword with its data.

    name : in capitals, without the star; options : key in capitals -> value, "" for a flag
    data : the data lines, split at commas; file, line : where it stands
    """

    name: str
    options: dict[str, str]
    data: list[list[str]]
    file: str
    line: int

    def option(self, *keys: str) -> str:
        """Value of the first of these options that is there, "" for none."""
        return next((self.options[key] for key in keys if key in self.options), "")

    def floats(self, fields: list[str], count: int) -> list[float]:
        """The first `count` numbers of a data line, 0 for what is left out; raises Refusal, naming the card."""
        return [self.number(text) for text in (fields + [""] * count)[:count]]

    def number(self, text: str) -> float:
        """A number as decks write it, 0 where it is left out."""
        try:
            return float(text.upper().replace("D", "E") or 0.0)
        except ValueError:
            raise Refusal(f"{self.where} expects a number, got '{text}': correct the line") from None

    def integer(self, text: str) -> int:
        """A whole number."""
        try:
            return int(text)
        except ValueError:
            raise Refusal(f"{self.where} expects a whole number, got '{text}': correct the line") from None

    @property
    def where(self) -> str:
        """Place of the card in a sentence."""
        return f"card *{self.name} at line {self.line} of '{self.file}'"


def cards(path: Path, within: tuple[Path, ...] = ()) -> Iterator[Card]:
    """All cards of a deck in order; the cards of an included file stand in place of its *INCLUDE.

    within : files that include this one
    Raises  Refusal: an included file that is not there, or data before the first card
    """
    if path.resolve() in within:
        raise Refusal(f"deck '{path}' includes itself: take the *INCLUDE out")
    card: Card | None = None
    pending = ""
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*") or pending:
            pending += text
            if pending.endswith(","):
                continue
            if card is not None:
                yield card
            card, pending = _card(pending, path, number), ""
            if card.name == "INCLUDE":
                other = path.parent / card.option("INPUT").strip("\"'")
                if not other.is_file():
                    raise Refusal(f"{card.where} names the file '{other.name}', which does not exist: put it there")
                yield from cards(other, (*within, path.resolve()))
                card = None
        elif card is None:
            raise Refusal(f"deck '{path}' has data at line {number} before any card: it is no deck of Abaqus")
        else:
            card.data.append([field.strip() for field in text.rstrip(",").split(",")])
    if card is not None:
        yield card


def _card(text: str, path: Path, line: int) -> Card:
    name, *options_text = text[1:].split(",")
    options = {}
    for item in options_text:
        key, _, value = item.partition("=")
        if key.strip():
            options["".join(key.upper().split())] = value.strip().strip('"')
    return Card(" ".join(name.upper().split()), options, [], path.name, line)

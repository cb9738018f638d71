"""The text of an Abaqus or CalculiX deck as a list of cards."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tribodyn.refusal import Refusal
from tribodyn.text_file import Line, lines_of, numbers_of

WITH_INPUT = ("INCLUDE", "NODE", "ELEMENT", "EQUATION", "DISTRIBUTION", "INITIAL CONDITIONS")
_QUOTED_COMMA = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')  # commas between names, not within quotes


@dataclass(frozen=True)
class Card:
    """One keyword with its data.

    name : in capitals, without the star; options : key in capitals -> value, "" for a flag
    data : the data lines, split at commas; file, line : where it stands"""

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
        (value,) = numbers_of([text.upper().replace("D", "E") or "0"]) or [math.nan]
        if not math.isfinite(value):
            raise Refusal(f"{self.where} expects a number, got '{text}': correct the line")
        return value

    def integer(self, text: str) -> int:
        """A whole number."""
        try:
            return int(text)
        except ValueError:
            raise Refusal(f"{self.where} expects a whole number, got '{text}': correct the line") from None

    def axis(self, text: str) -> int:
        """An axis 0..5, counted from 1 in the deck."""
        if text not in tuple("123456"):
            raise Refusal(f"{self.where} names the direction '{text}': count from 1 to 6")
        return int(text) - 1

    @property
    def where(self) -> str:
        """Place of the card in a sentence."""
        return f"card *{self.name} at line {self.line} of '{self.file}'"


def cards(path: Path) -> Iterator[Card]:
    """All cards of a deck in order; the cards of an included file stand in place of its *INCLUDE.

    Raises  Refusal: an included file that is not there, or data before the first card"""
    card: Card | None = None
    for line in lines_of(path, "**", _continues, _included_name):
        text = line.text.strip()
        if text.startswith("*"):
            following = _card(text, line)
            if following.name == "INCLUDE":  # its lines may be data of the card before
                if not following.option("INPUT"):
                    raise Refusal(f"{following.where} names no file: give INPUT")
                continue
            if card is not None:
                yield card
            card = following
        elif card is None:
            raise Refusal(f"deck '{path}' has data at line {line.number} before any card: it is no deck of Abaqus")
        else:
            card.data.append(_fields(text.rstrip(",")))
    if card is not None:
        yield card


def _card(text: str, line: Line) -> Card:
    name, *options_text = _QUOTED_COMMA.split(text[1:])
    options = {}
    for item in options_text:
        key, _, value = item.partition("=")
        if key.strip():
            options["".join(key.upper().split())] = _unquoted(value)
    return Card(" ".join(name.upper().split()), options, [], line.file.name, line.number)


def _fields(text: str) -> list[str]:
    """The fields of a data line."""
    return [_unquoted(field) for field in (_QUOTED_COMMA.split(text) if '"' in text else text.split(","))]


def _unquoted(text: str) -> str:
    """A name without quotes; of one that is a number they tell it from a label."""
    name = text.strip()
    return name if name.strip('"').isdigit() else name.replace('"', "")


def _continues(line: str) -> bool:
    """Whether a line with a keyword goes on in the next."""
    return line.lstrip()[:1] == "*" and line.rstrip()[-1:] == ","


def _included_name(line: str) -> str:
    """File of an *INCLUDE, or with the data of another card."""
    if line.lstrip()[:1] == "*" and (card := _card(line.strip(), Line(line, Path(), 0))).name in WITH_INPUT:
        return card.option("INPUT").strip("'")
    return ""

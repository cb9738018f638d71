"""The text of Nastran files as cards with fields, and the cards that others refer to.

These are grid points, systems, stiffnesses of springs and sums of sets."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from tribodyn import text_file
from tribodyn.geometry.sources.directions import System
from tribodyn.geometry.sources.raw_mesh import LabelledMesh
from tribodyn.refusal import Refusal

KINDS = {"R": "rectangular", "C": "cylindrical", "S": "nastran spherical"}
_EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")


def lines_of(path: Path) -> Iterator[str]:
    """Lines of a file without comments; the lines of an included file stand in place of its INCLUDE."""
    for line in text_file.lines_of(path, "$", _continues, _included_name):
        text = line.text.split("$")[0].rstrip()
        if text and not _included_name(text):
            yield text


def _continues(line: str) -> bool:
    """Whether the name of an INCLUDE goes on in the next line: its quotes are not closed."""
    return line.lstrip()[:7].upper() == "INCLUDE" and (line.count("'") == 1 or line.count('"') == 1)


def _included_name(line: str) -> str:
    text = line.split("$")[0].strip()
    return text[7:].strip().strip("\"'") if text[:7].upper() == "INCLUDE" else ""


@dataclass
class BulkCard:
    """A card, or a continuation whose card is not met yet.

    name : in capitals, of a continuation what its card ends with; marker : what its own continuation begins with"""

    name: str
    fields: list[str]
    marker: str

    def extend(self, continuation: BulkCard) -> None:
        """Go on with the fields of a continuation."""
        self.fields, self.marker = self.fields + continuation.fields, continuation.marker


def cards_of(lines: Iterable[str]) -> Iterator[tuple[str, list[str]]]:
    """Name and fields of each card, up to ENDDATA.

    Continuations go by their markers, wherever they stand; where a line has none they belong to the line before.
    Raises  Refusal: a continuation without a card"""
    cards: list[BulkCard] = []
    loose: dict[str, BulkCard] = {}
    previous: BulkCard | None = None
    items = [_line(line) for line in takewhile(lambda line: line.lstrip()[:7].upper() != "ENDDATA", lines)]
    markers = {item.marker for item in items}
    for item in items:
        if item.name[:1] not in ("", "+", "*"):
            previous = replace(item, name=item.name.rstrip("*").upper())
            cards.append(previous)
            continue
        item.name = item.name.strip("+* ")
        here = previous.marker if previous is not None else ""
        if previous is not None and (item.name in ("", here) or (not here and item.name not in markers)):
            previous.extend(item)
        elif not item.name or item.name in loose:
            raise Refusal(f"the continuation +{item.name} {item.fields[0]} stands twice or has no card: take it out")
        else:
            previous = loose[item.name] = item
    for card in cards:
        while card.marker in loose:
            card.extend(loose.pop(card.marker))
    if loose:
        raise Refusal(f"no card ends with the marker of the continuation +{min(loose)}: correct one of the two")
    return ((card.name, card.fields + [""] * 8) for card in cards)


def _line(line: str) -> BulkCard:
    """A line of eight fields, or the four of a name with a star, in fixed format or between commas.

    Between commas the tenth place is a marker where it begins with + or *; else a line may have any number of fields.
    """
    if "," in line:
        name, *fields = [item.strip() for item in line.split(",")]
        count = 4 if "*" in name else 8
        marker = fields.pop() if len(fields) == count + 1 and fields[-1][:1] in ("+", "*", "") else ""
        if count == 4 and any(fields[4:]):
            raise Refusal(f"the line '{line[:40]}' has more than the four fields of a star: take the star out")
        fields += [""] * (-len(fields) % count)
    else:
        line = line.expandtabs(8)
        name, marker = line[:8].strip(), line[72:80].strip()
        width, count = (16, 4) if "*" in name else (8, 8)
        fields = [line[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]
    return BulkCard(name, fields, marker.strip("+* "))


def selected_sets(control: str) -> dict[str, set[int]]:
    """Sets of supports, equations and loads that the case control selects."""
    numbers_of: dict[str, set[int]] = {"SPC": set(), "MPC": set(), "LOAD": set()}
    for kind, number in re.findall(r"(?im)^\s*(SPC|MPC|LOAD)\s*=\s*(\d+)", control):
        numbers_of[kind.upper()].add(int(number))
    return numbers_of


def case_sets(control: str, labels: Collection[int]) -> Iterator[tuple[int, list[int]]]:
    """SET n = 1, 5 THRU 9 of the case control, with lines that a comma continues."""
    for number, items in re.findall(r"(?im)^\s*SET\s+(\d+)\s*=\s*((?:[^\n]*,[ \t]*\n)*[^\n]*)", control):
        words = items.replace(",", " ").split()
        if all(word.isdigit() or word.upper() == "THRU" for word in words):
            yield int(number), expand_list(words, labels)


def expand_list(words: list[str], labels: Collection[int]) -> list[int]:
    """Numbers of a list with THRU; of a range that is longer than the file has labels, those that it has."""
    numbers: list[int] = []
    items = iter(word for word in words if word)
    for word in items:
        if word.upper() == "THRU":
            first, last = (numbers or [0])[-1], to_int(next(items, ""), "a list with THRU")
            if not 0 < first <= last:
                raise Refusal(f"a list has {first} THRU {last}: count up from 1")
            is_wide = last - first > len(labels)
            numbers += sorted(n for n in labels if first < n <= last) if is_wide else range(first + 1, last + 1)
        else:
            numbers.append(to_int(word, "a list of numbers and THRU"))
    return numbers


def to_axes(text: str, card: str, is_one: bool = False) -> tuple[int, ...]:
    """Axes 0..5 of digits 1 to 6. is_one : whether the card takes one"""
    if set(text) - set("123456") or (is_one and len(text) != 1):
        raise Refusal(f"{card} names the directions '{text}': write {'one digit' if is_one else 'digits'} from 1 to 6")
    return tuple(int(digit) - 1 for digit in text)


def to_int(text: str, card: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise Refusal(f"{card} expects a whole number, got '{text}': correct the card") from None


def to_float(text: str, card: str) -> float:
    """A number as Nastran writes it, such as 1.-3, 0 for none."""
    try:
        return text_file.finite(_EXPONENT.sub(r"e\1", text.upper().replace("D", "E")))
    except ValueError:
        raise Refusal(f"{card} expects a number, got '{text}': correct the card") from None


@dataclass
class ReferenceCards:
    """Cards by their number, before the others are read.

    chosen : kind of set -> numbers that the case control selects, None where there is no case control
    grids, springs : cards; systems : of coordinate systems; built : those that are built; scales : of load sets
    unselected : a clause for each set that is not in force; defined : kind and number of each set
    common : fields of GRDSET"""

    path: Path
    mesh: LabelledMesh
    chosen: dict[str, set[int]] | None
    grids: dict[int, list[str]] = field(default_factory=dict)
    systems: dict[int, tuple[str, list[str]]] = field(default_factory=dict)
    built: dict[int, System] = field(default_factory=dict)
    springs: dict[int, float] = field(default_factory=dict)
    scales: dict[int, float] = field(default_factory=dict)
    unselected: set[str] = field(default_factory=set)
    defined: set[tuple[str, int]] = field(default_factory=set)
    common: list[str] = field(default_factory=lambda: [""] * 8)

    def system(self, text: str) -> System | None:
        """A system by its number, None for the basic one."""
        number = to_int(text or "0", "a system")
        if number and number not in self.built:
            if number not in self.systems:
                raise Refusal(f"'{self.path}' names the system {number}, which it has not: add its CORD card")
            name, fields = self.systems.pop(number)  # gone while it is built: one that refers to itself ends there
            if name[4] == "1":
                three = np.array([self.place(to_int(label, name)) for label in fields[:3]])
            else:
                of = self.system(fields[0])
                three = np.array([to_float(text, name) for text in fields[1:10]]).reshape(3, 3)
                three = three if of is None else of.places(three)
            self.built[number] = System.of_points(KINDS[name[5]], *three)
        return self.built.get(number)

    def place(self, label: int) -> np.ndarray:
        """A grid point (3,) in the basic system."""
        if label not in self.grids:
            raise Refusal(f"'{self.path}' names the grid point {label}, which it has not: the file is cut off")
        fields = self.grids[label]
        local, of = np.array([[to_float(text, "GRID") for text in fields[2:5]]]), self.system(fields[1])
        return np.asarray(local if of is None else of.places(local))[0]

    def selected(self, kind: str, text: str) -> bool:
        """Whether a set of supports, equations or loads is in force."""
        self.defined.add((kind, to_int(text, kind)))
        if self.chosen is None or to_int(text, kind) in self.chosen[kind]:
            return True
        self.unselected.add(f"set {kind} {text}, which the case control does not select")
        return False

    def keep(self, card: str, fields: list[str]) -> None:
        """A grid point, systems, stiffnesses of springs."""
        if card == "GRID":
            self.grids[to_int(fields[0], card)] = fields
            fields[1:8] = [text or preset for text, preset in zip(fields[1:8], self.common[1:8], strict=True)]
        elif card.startswith("CORD2"):
            self.systems[to_int(fields[0], card)] = card, [*fields[1:], *[""] * 9]
        else:
            for start in (start for start in (0, 4) if fields[start]):
                number = to_int(fields[start], card)
                if card == "PELAS":
                    self.springs[number] = to_float(fields[start + 1], card)
                else:
                    self.systems[number] = card, fields[start + 1 : start + 4]

    def add(self, card: str, fields: list[str]) -> None:
        """A sum of sets."""
        number = to_int(fields[0], card)
        self.defined.add((card[:3] if card != "LOAD" else card, number))
        if card == "LOAD":
            if self.chosen is None or number in self.chosen[card]:
                total_scale, parts = to_float(fields[1], card), [text for text in fields[2:] if text]
                for scale, of in zip(parts[::2], parts[1::2], strict=False):
                    more = total_scale * to_float(scale, card)
                    self.scales[to_int(of, card)] = self.scales.get(to_int(of, card), 0.0) + more
                    if self.chosen is not None:
                        self.chosen[card].add(to_int(of, card))
        elif self.chosen is not None and number in self.chosen[card[:3]]:
            self.chosen[card[:3]].update(to_int(text, card) for text in fields[1:] if text)

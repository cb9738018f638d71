"""The text of Nastran files as cards with fields; numbers, lists and directions of a field."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from tribodyn.refusal import Refusal

_EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")


def lines_of(path: Path, within: tuple[Path, ...] = ()) -> Iterator[str]:
    """Lines of a file without comments, those of included files in their place."""
    if path.resolve() in within:
        raise Refusal(f"'{path}' includes itself: take the INCLUDE out")
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        text = line.split("$")[0].rstrip()
        if text.upper().startswith("INCLUDE"):
            other = path.parent / text[7:].strip().strip("\"'")
            if not other.is_file():
                raise Refusal(f"INCLUDE of '{path}' names '{other.name}', which does not exist: put it there")
            yield from lines_of(other, (*within, path.resolve()))
        elif text:
            yield text


def cards_of(lines: Iterable[str]) -> Iterator[tuple[str, list[str]]]:
    """Name and fields of each card of the bulk data, continuation lines joined."""
    name, fields = "", []
    for line in lines:
        head, line_fields = _fields(line)
        if head in ("", "+", "*") or head[0] in "+*":
            fields += line_fields
            continue
        if name:
            yield name, fields + [""] * 8
        name, fields = head.rstrip("*").upper(), line_fields
    if name:
        yield name, fields + [""] * 8


def _fields(line: str) -> tuple[str, list[str]]:
    """Name and fields of a line: eight, or the four of a name with a star, in free and in fixed format."""
    if "," in line:
        head, *items = [item.strip() for item in line.split(",")]
        if "*" in head and any(item and item[0] not in "+*" for item in items[4:]):
            raise Refusal(f"the line '{line[:40]}' has more than the four fields of a star: take the star out")
        count = 4 if "*" in head else 8
        return head, (items + [""] * count)[:count]
    line = line.expandtabs(8)
    head = line[:8].strip()
    width, count = (16, 4) if "*" in head else (8, 8)
    return head, [line[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]


def selected_sets(control: str) -> dict[str, set[int]]:
    """Sets of supports, equations and loads that the case control selects."""
    numbers_of: dict[str, set[int]] = {"SPC": set(), "MPC": set(), "LOAD": set()}
    for kind, number in re.findall(r"(?im)^\s*(SPC|MPC|LOAD)\s*=\s*(\d+)", control):
        numbers_of[kind.upper()].add(int(number))
    return numbers_of


def case_sets(control: str) -> Iterator[tuple[int, list[int]]]:
    """SET n = 1, 5 THRU 9 of the case control, with lines that a comma continues."""
    for number, items in re.findall(r"(?im)^\s*SET\s+(\d+)\s*=\s*((?:[^\n]*,[ \t]*\n)*[^\n]*)", control):
        words = items.replace(",", " ").split()
        if all(word.isdigit() or word.upper() == "THRU" for word in words):
            yield int(number), expand_list(words)


def expand_list(words: list[str]) -> list[int]:
    numbers: list[int] = []
    words = [word for word in words if word]
    i = 0
    while i < len(words):
        if words[i].upper() == "THRU":
            numbers += range(numbers[-1] + 1, to_int(words[i + 1], "a list with THRU") + 1)
            i += 1
        else:
            numbers.append(to_int(words[i], "a list"))
        i += 1
    return numbers


def to_axes(text: str, card: str) -> tuple[int, ...]:
    """Axes 0..5 of digits 1 to 6."""
    if set(text) - set("123456"):
        raise Refusal(f"{card} names the directions '{text}': write digits from 1 to 6")
    return tuple(int(digit) - 1 for digit in text)


def to_int(text: str, card: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise Refusal(f"{card} expects a whole number, got '{text}': correct the card") from None


def to_float(text: str, card: str) -> float:
    """A number as Nastran writes it, such as 1.-3, 0 for none."""
    try:
        return float(_EXPONENT.sub(r"e\1", text.upper().replace("D", "E")) or 0.0)
    except ValueError:
        raise Refusal(f"{card} expects a number, got '{text}': correct the card") from None

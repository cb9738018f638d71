"""What becomes of each card of a deck: one table a format, used by its reader, the tests and the pages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property


def listed(counts: Mapping[str, int]) -> str:
    """Names with how often each was met, as a clause."""
    return ", ".join(f"{name} ({count})" if count > 1 else name for name, count in counts.items())


def words(text: str) -> frozenset[str]:
    """Names out of a text, between commas."""
    return frozenset(" ".join(name.split()) for name in text.split(",")) - {""}


@dataclass(frozen=True)
class CardTable:
    """What a format's reader does with its cards. A card that the table does not know is refused.

    read : carried over; silent : of no effect, not worth a word; harmless : why -> cards that are named and not used
    """

    read: str
    silent: str
    harmless: Mapping[str, str]

    @cached_property
    def reads(self) -> frozenset[str]:
        """Cards that are carried over."""
        return words(self.read)

    @cached_property
    def silents(self) -> frozenset[str]:
        """Cards of no effect."""
        return words(self.silent)

    @cached_property
    def spares(self) -> Mapping[str, str]:
        """Harmless card -> why."""
        return {name: reason for reason, text in self.harmless.items() for name in words(text)}


@dataclass
class SkippedCards:
    """Cards of a file that are not read. mark : prefix of a card's name in sentences"""

    table: CardTable
    mark: str = ""
    ignored: Counter[str] = field(default_factory=Counter)
    refused: dict[str, str] = field(default_factory=dict)

    def skip(self, name: str) -> None:
        """A card that is not read."""
        if name in self.table.spares:
            self.ignored[self.mark + name] += 1
        elif name not in self.table.silents:
            self.refuse(self.mark + name)

    def refuse(self, name: str) -> None:
        """What would change stiffness, mass, support or load."""
        self.refused.setdefault(name, f"{name}")

    def unused(self) -> list[str]:
        """A clause on those that change nothing."""
        return [f"cards {listed(self.ignored)}"] if self.ignored else []

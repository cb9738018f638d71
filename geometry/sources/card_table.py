"""What becomes of each card of a deck: one table a format, used by its reader, the tests and the pages.

A reader declares for each card that it reads the parameters and the data fields that it knows, as texts: names between
commas; (NAME) is known to be of no effect here; NAME=A|B takes no value but those that begin with A or B; "..." stands
for any more. It passes what stands on a card to `SkippedCards.check_parameters` and `check_fields`: what is not
declared is refused by its name."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property


def listed(counts: Mapping[str, int]) -> str:
    """Names with how often each was met, as a clause."""
    return ", ".join(f"{name} ({count})" if count > 1 else name for name, count in counts.items())


def words(text: str) -> frozenset[str]:
    """Names out of a text, between commas."""
    return frozenset(" ".join(name.split()) for name in text.split(",")) - {""}


def fields_of(text: str) -> dict[str, str]:
    """Card -> names of its fields, out of a text such as "CELAS1 CELAS2: EID, PID; GRID: ID"."""
    parts = (part.split(":") for part in text.split(";"))
    return {card: names.strip() for cards, names in parts for card in cards.split()}


@dataclass(frozen=True)
class CardTable:
    """What a format's reader does with its cards. A card that the table does not know is refused.

    read : carried over; silent : of no effect, not worth a word; harmless : why -> cards that are named and not used
    fields : card -> names of its fields in their order; (NAME) is of no effect here; one without a name, or beyond the
        last, is refused where it is neither blank nor 0; "..." are more of the last kind; ";" ends a line's
    parameters : card -> names of its parameters"""

    read: str
    silent: str
    harmless: Mapping[str, str]
    fields: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, str] = field(default_factory=dict)

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

    def check_fields(self, name: str, values: Sequence[str], line: int = 0) -> None:
        """Refuse a card with a value in a field that its reader does not know. line : of the card's data, from 0"""
        lines = self.table.fields.get(name, "...").split(";")
        known = [field_name.strip() for field_name in lines[min(line, len(lines) - 1)].split(",")]
        for k, value in enumerate(values if known[-1] != "..." else values[: len(known) - 1]):
            if value.strip("0.") and (k >= len(known) or not known[k]):
                self.refuse(f"{self.mark}{name}, {value} in field {k + 1}")

    def check_parameters(self, name: str, options: Mapping[str, str]) -> None:
        """Refuse a card with a parameter, or a value of one, that its reader does not know.

        options : parameter in capitals, without blanks -> its value"""
        items = [item.strip("( )") for item in self.table.parameters.get(name, "...").split(",")]
        known = {key.replace(" ", ""): values for key, _, values in (item.partition("=") for item in items)}
        for key, value in options.items():
            if key not in known and "..." not in known:
                self.refuse(f"{self.mark}{name}, {key}")
            elif not "".join(value.upper().split()).startswith(tuple(known.get(key, "").split("|"))):
                self.refuse(f"{self.mark}{name}, {key}={value}")

    def unused(self) -> list[str]:
        """A clause on those that change nothing."""
        return [f"cards {listed(self.ignored)}"] if self.ignored else []

"""Whether settings that were chosen for a wanted accuracy meet it: held against one run that is finer in every knob."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tribodyn.workflows.accuracy.accuracy import OF_WEAR, Choice, parsed, table_of, tuned
from tribodyn.workflows.accuracy.knobs import Study, study_of
from tribodyn.workflows.accuracy.measure import Measured, measure
from tribodyn.workflows.accuracy.trade_table import ANSWERED, NAMES, QUANTITIES, Trade
from tribodyn.workflows.scene import scene_file


@dataclass(frozen=True)
class Line:
    """One quantity: relative errors that were wanted, expected by the trade, and found; values in SI units."""

    scene: str
    quantity: str
    wanted: float
    expected: float
    found: float
    value: float
    reference: float

    @property
    def kept(self) -> bool:
        """Whether the promise was kept."""
        return abs(self.found) <= self.wanted


@dataclass(frozen=True)
class Check:
    """A promise beside what was found.

    chosen, finer : overrides, the finer ones by what they were run for; seconds : of the chosen, expected and found
    """

    lines: tuple[Line, ...]
    chosen: tuple[str, ...]
    finer: dict[str, tuple[str, ...]]
    seconds: tuple[float, float]

    @property
    def kept(self) -> bool:
        """Whether every promise was kept."""
        return all(line.kept for line in self.lines)


def check(scene: str, overrides: Sequence[str], accuracy: str, table: Path | None, say: Callable[[str], None]) -> Check:
    """Run the settings that an accuracy chooses, as `run` would, and the scene with all knobs finer at once.

    accuracy : as workflows.accuracy.parsed reads it; table : the trade to go by, the scene's own where None
    Depth and life are held against the finest settings that were worn, all else against the finest of all.
    Raises  ValueError where the accuracy cannot be promised, RuntimeError where a run does not converge
    """
    wanted, *_ = parsed(accuracy)
    file, choice = tuned(scene, overrides, accuracy, table)
    say(choice.sentence)
    trade, study = table_of(scene_file.read(scene, overrides), table), study_of(file)
    worn = [q for q in choice.errors if q in OF_WEAR]
    others = [q for q in choice.errors if q not in OF_WEAR]
    ours = _measured(file, bool(worn), False, say)
    finer: dict[str, tuple[str, ...]] = {}
    truth: dict[str, float | None] = {}
    for name, quantities, more in (("response", others, study.check), ("wear", worn, study.check_worn)):
        if quantities:
            finer[name] = (*finest(trade, choice, quantities), *_concerned(more, study, choice))
            reference = _measured(scene_file.read(scene, (*overrides, *finer[name])), name == "wear", True, say)
            truth |= {q: reference.values[q] for q in quantities}
    lines = []
    for quantity, expected in choice.errors.items():
        value, right = ours.values[quantity], truth[quantity]
        assert value is not None
        assert right is not None
        lines.append(Line(file.name, quantity, wanted, expected, value / right - 1, value, right))
    return Check(tuple(lines), choice.overrides, finer, (choice.seconds, ours.seconds))


def finest(trade: Trade, choice: Choice, quantities: Sequence[str]) -> tuple[str, ...]:
    """Overrides that set every knob of a choice to its finest setting for which the quantities were measured.

    Knobs that find the peak are left alone: the finer run refines it.
    """
    found: list[str] = []
    for chosen in (row for row in choice.rows if trade.of(row.knob)[-1].overrides):
        good = [row for row in trade.of(chosen.knob) if row.tunable and row.outcome == ANSWERED]
        measured = [row for row in good if any(row.values[q] is not None for q in quantities)]
        found += (measured or good)[-1].overrides
    return tuple(found)


def _concerned(more: Sequence[str], study: Study, choice: Choice) -> list[str]:
    """Those of `more` that set no knob which the choice leaves alone."""
    ours = {text.partition("=")[0] for text in choice.overrides}
    knobs = {text.partition("=")[0] for knob in study.knobs for s in knob.settings for text in s.overrides}
    return [text for text in more if text.partition("=")[0] not in knobs - ours]


def _measured(file: scene_file.SceneFile, wears: bool, refined: bool, say: Callable[[str], None]) -> Measured:
    found = measure(file, wears, refined)
    say(f"{'; '.join(file.overrides)}: {found.seconds:.1f} s, {found.outcome}")
    if found.outcome != ANSWERED:
        raise RuntimeError(f"{file.name} with {'; '.join(file.overrides)}: {found.outcome}")
    return found


def as_text(found: Check) -> str:
    """The check for people."""
    rows = [f"{'quantity':15} {'chosen':>12} {'finer':>12} {'wanted':>8} {'expected':>9} {'found':>9}"]
    for line in found.lines:
        name = NAMES[QUANTITIES.index(line.quantity)]
        errors = f"{line.wanted:8.2%} {line.expected:9.2%} {line.found:+9.2%}"
        verdict = "" if line.kept else "  BROKEN"
        rows.append(f"{name:15} {line.value:12.6g} {line.reference:12.6g} {errors}{verdict}")
    expected, ours = found.seconds
    rows.append(f"chosen: {', '.join(found.chosen)}: {ours:.1f} s of one processor ({expected:.2g} s expected)")
    rows += [f"finer {name}: {', '.join(overrides)}" for name, overrides in found.finer.items()]
    return "\n".join([*rows, "promise kept" if found.kept else "promise broken"])


def as_record(found: Check) -> dict[str, Any]:
    """The check for machines."""
    return asdict(found) | {"lines": [{**asdict(line), "kept": line.kept} for line in found.lines]}

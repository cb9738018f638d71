"""A scene with all its knobs finer at once: what its verdict or a promise is held against.

Not finer than any verdict could be: a reference that has 2.6 times the elements along every edge shows 62 % of an error
of first order and 85 % of one of second.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tribodyn.hbm import threads
from tribodyn.hbm.continuation.operating_point import NoPeak
from tribodyn.hbm.wear.history import cycles_to_preload
from tribodyn.workflows.accuracy import other_meshes, probes
from tribodyn.workflows.accuracy.refinement import Promise
from tribodyn.workflows.accuracy.statement import NAMES, QUANTITIES, UNITS, loaded
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling, wear_run
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile

ELEMENTS = 2.6  # of the reference along every edge, over those of the scene: three where that has one
OF_WORN = 2.0  # the same, of the reference that wears, which takes hundreds of solves
OF_PROMISED = 1.75  # the same, over those that a promise was made with, which are finer already
MODES, CUTOFF = 3, 2  # times those of the scene
HARMONICS, LOWEST = 3, 5  # more than the scene's; the highest at the least
STEPS = 3  # wear steps in each of the scene

Values = dict[str, float | None]
MEASURED = "measured"
OF_WEAR = ("depth", "life")


@dataclass(frozen=True)
class Held:
    """A quantity that a promise is of beside the reference.

    value, reference : in SI units; wanted : relative error; true : what was found, None without a reference
    """

    quantity: str
    value: float
    reference: float | None
    wanted: float
    true: float | None

    @property
    def broken(self) -> bool:
        """Whether the true error is above the wanted one."""
        return self.true is not None and self.true > self.wanted


def held(file: SceneFile, result: Result, promise: Promise, seconds: float) -> tuple[tuple[Held, ...], str]:
    """What is promised of the last round beside a reference that is finer in every knob, and why it lacks if it does.

    file : the scene that the accuracy was asked of; result : of the last round; seconds : of the processor, at most
    """
    names = [name for name, why in promise.reasons.items() if not why]
    wears = any(name in OF_WEAR for name in names)
    last = file.changed(*(() if wears else ("wear=",)), *promise.overrides)
    truth, outcome = solved(last, seconds, OF_PROMISED)
    said = loaded(result.verdict).statements
    found = []
    for name in names:
        value, right = said[name].value, truth[name]
        assert value is not None
        true = None if right is None else probes.relative(value, right)
        found.append(Held(name, value, right, promise.wanted, true))
    return tuple(found), "" if outcome == MEASURED else outcome


def as_text(found: Sequence[Held], lacking: str) -> str:
    """A promise beside its reference, for people."""
    lines = [f"{'quantity':15} {'promised':>12} {'reference':>12}      {'wanted':>8} {'found':>8}"]
    for one in found:
        right = "not known" if one.reference is None else f"{one.reference:.6g}"
        true = "not known" if one.true is None else f"{one.true:.2%}"
        name = f"{NAMES.get(one.quantity, one.quantity):15}"
        end = "  BROKEN" if one.broken else ""
        lines.append(f"{name} {one.value:12.6g} {right:>12} {UNITS[one.quantity]:6}{one.wanted:8.2%} {true:>8}{end}")
    if lacking:
        return "\n".join([*lines, lacking])
    return "\n".join([*lines, "promise broken" if any(one.broken for one in found) else "promise kept"])


def as_records(found: Sequence[Held]) -> list[dict[str, Any]]:
    """The same for machines."""
    return [asdict(one) | {"broken": one.broken} for one in found]


def solved(file: SceneFile, seconds: float, elements: float = ELEMENTS) -> tuple[Values, str]:
    """What the scene says with all knobs finer, and "measured" or why there is nothing to say.

    Its peak is found by the search that wear runs begin with, which needs no points of a response. Without wear first;
    then with wear, on OF_WORN times the elements, in as many seconds again
    """
    fine = finer(file, elements)
    values: Values = dict.fromkeys(QUANTITIES)
    what = "its reference"
    try:
        with processor_seconds(seconds), threads.limited(1):
            model = modelling.build(fine, None, Progress())
            there = probes.unworn(fine, model).answers
        values |= {name: value for name, value, _ in probes.compared(there, there)}
        wear = fine.scene.wear
        if fine.scene.wears and wear is not None:
            what = "the reference of its wear"
            fine = finer(file, min(elements, OF_WORN))
            with processor_seconds(seconds), threads.limited(1):
                worn = wear_run.worn_out(fine, modelling.build(fine, None, Progress()), wear.lost_below)
            if worn.ended.failed:
                raise RuntimeError(str(worn.end))
            values["depth"] = float((worn.depth[-1] + worn.worn[-1]).max())
            values["life"] = cycles_to_preload(worn)
    except TimeUp:
        return values, f"{'measured, ' * (what != 'its reference')}{what} is too dear"
    except (NoPeak, ValueError, RuntimeError) as refusal:
        return values, f"{'measured, ' * (what != 'its reference')}{what} is refused: {refusal}"
    return values, MEASURED


def finer(file: SceneFile, elements: float = ELEMENTS) -> SceneFile:
    """The scene with every knob finer.

    elements : along every edge, over those of the scene; those of a given mesh are halved
    """
    return other_meshes.refined(file, elements).changed(*_finer_knobs(file))


def _finer_knobs(file: SceneFile) -> Iterator[str]:
    """Overrides that make all finer but the mesh."""
    scene = file.scene
    reduction = getattr(scene, "reduction", None)
    if reduction is not None and reduction.modes is not None:
        yield f"reduction.modes={MODES * reduction.modes}"
    if reduction is not None and reduction.cutoff is not None:
        yield f"reduction.cutoff={CUTOFF * reduction.cutoff!r}"
    top = max(max(scene.harmonics.kept) + HARMONICS, LOWEST)
    yield f"harmonics.kept={list(range(top + 1))}"
    yield f"harmonics.samples={max(2 * scene.harmonics.samples, 16 * top)}"
    yield f"solver.tolerance={0.1 * scene.solver.tolerance!r}"
    wear = scene.wear
    if wear is not None:
        yield f"wear.max_steps={4 * STEPS * wear.max_steps}"
        if wear.rule == "error_controlled" and wear.tolerance is not None:
            yield f"wear.tolerance={wear.tolerance / STEPS!r}"
        elif wear.step is not None and wear.step.share is not None:
            yield f"wear.step={wear.step.share / STEPS!r}"

"""What a scene answers with more elements, harmonics and modes at once, and the total error that follows.

One knob at a time misses what two of them do together: a higher harmonic that meets a mode of a finer mesh alone, or
changes of three knobs that each are small and add up. The sum of single changes without their signs, on the other hand,
is mostly too wide. Where all knobs can be made finer at once, that change is the estimate, and the sum only its margin.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.workflows.accuracy import other_meshes, probes
from tribodyn.workflows.accuracy.probes import OnCurve, State, compared, relative
from tribodyn.workflows.accuracy.statement import LARGEST, Contribution
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile

AT_ONCE = "all knobs at once"
MESH, HARMONICS, MODES = "mesh and contact grid", "harmonics", "modes"
KNOBS = (MESH, HARMONICS, MODES)
ELEMENTS = other_meshes.STILL_FINER  # along every edge, over those of the scene
RICH = 5  # highest harmonic, at the least
MOST_UNKNOWNS = 6000  # of that balance
# TIMES, MARGIN and ALONE are those of the scoreboard (docs/accuracy/scoreboard.md): on 118 scenes of five seeds none of
# 302 errors comes nearer to the true one than 1.4 times. Twice the elements show half of an error of first order and
# three quarters of one of second: 1.75 times lies between both, and the margin covers the rest
TIMES = 1.75  # of the change by all knobs at once
MARGIN = 0.3  # of the sum of the changes by each knob, beside it
LEAST = 1e-3  # error of what a mesh changes at all, below which none is stated: meshes agree by chance on small errors
ALONE = 1.3  # times that sum, where all knobs at once have not been tried


def contributions(file: SceneFile, n_dof: int, first: State, seconds: float) -> Iterator[Contribution]:
    """What all knobs at once change in the unworn contact; nothing where they are too dear.

    n_dof : of the scene's own mesh; seconds : of the processor
    """
    balance = first.balance
    top = max(RICH, harmonic_choice.climb(balance.basis.harmonics[-1])[0])
    unknowns = ELEMENTS**2 * balance.contact.stiffness.size * (2 * top + 1)
    if isinstance(first.site, OnCurve) or unknowns > MOST_UNKNOWNS or ELEMENTS**3 * n_dof > other_meshes.MOST_FINER[0]:
        return
    finer = finer_at_once(file, top)
    how = f"{ELEMENTS:g} times the elements, harmonics 0 to {top} and more modes"
    try:
        with processor_seconds(seconds):
            there = probes.unworn(finer, modelling.build(finer, None, Progress()))
    except TimeUp:
        return
    except (ValueError, RuntimeError) as refusal:
        for name, _, _ in compared(first.answers, first.answers):
            yield Contribution(AT_ONCE, name, None, f"{how}: {refusal}")
        return
    for name, a, b in compared(first.answers, there.answers):
        yield Contribution(AT_ONCE, name, relative(a, b), how)


def finer_at_once(file: SceneFile, top: int) -> SceneFile:
    """The scene with ELEMENTS times the elements along every edge, harmonics to `top` and twice as many modes."""
    more_modes = other_meshes.with_more_modes(file)
    meshed = other_meshes.refined(file if more_modes is None else more_modes.file, ELEMENTS)
    samples = max(file.scene.harmonics.samples, 16 * top)
    return meshed.changed(f"harmonics.kept={list(range(top + 1))}", f"harmonics.samples={samples}")


def total(parts: Iterable[Contribution]) -> float:
    """Total relative error of one quantity from its contributions, as far as they are known.

    TIMES the change by all knobs at once and MARGIN of the sum of the changes by each; ALONE of that sum where all at
    once are not known, or the sum itself is above LARGEST and tells that nothing has settled; LEAST or that sum at the
    least. Others are added
    """
    known = [(part.source, part.error) for part in parts if part.error is not None and np.isfinite(part.error)]
    once = [error for source, error in known if source == AT_ONCE]
    each = sum(error for source, error in known if source in KNOBS)
    others = sum(error for source, error in known if source not in (*KNOBS, AT_ONCE))
    if not once or each > LARGEST:
        return ALONE * each + others
    return max(TIMES * once[0] + MARGIN * each, min(each, LEAST)) + others

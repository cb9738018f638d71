"""Stress of random scenes at their resonance against the modes that are retained, beside nearly all of them.

Two numbers: the largest stress of von Mises at a named place that is drawn, whose static shapes are among the
coordinates, and that of all nodes at which it is finite, which is recovered from the full field."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from proof.unseen_scenes.scoreboard_scenes import draw
from tribodyn.fem.singularities import singular_nodes
from tribodyn.hbm import newton, quantity
from tribodyn.refusal import SolverFailure
from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.progress import Progress

MODES = (20, 40, 80, 320)
Row = tuple[str, np.ndarray, np.ndarray]


def run(scenes: int, seed: int, say: Callable[[str], None]) -> list[Row]:
    """Name, changes (4, 2) to the last of MODES over it, and errors (2, 2) that twice the modes state of the first."""
    rows = []
    for number in range(scenes):
        try:
            with TemporaryDirectory() as folder:
                name, values = measured(number, seed, Path(folder))
        except (ValueError, RuntimeError) as refusal:
            say(f"scene {number} left out: {refusal}")
            continue
        stated = [[DEFAULT.total(abs(b / a - 1), 2.0) for a, b in zip(*pair, strict=True)] for pair in
                  (values[:2], values[1:3])]  # fmt: skip
        rows.append((name, np.abs(values / values[-1] - 1), np.array(stated)))
        say(f"{name}: {', '.join(f'{change:.1e}' for change in rows[-1][1][:3].ravel())}")
    return rows


def measured(number: int, seed: int, folder: Path) -> tuple[str, np.ndarray]:
    """Name of a scene, and (4, 2) both numbers [Pa] with each of MODES."""
    drawn = draw(number, seed, folder)
    file, values = drawn.file(folder).changed("wear=", "reduction="), []
    part = modelling.build(file, Progress()).part
    assert part is not None
    regular = np.flatnonzero(singular_nodes(part) == 0)
    point = part.points[np.random.default_rng([seed, number, 1]).choice(regular)].tolist()
    omega = 2 * np.pi * file.scene.response.frequency[1] / 1.2
    for modes in MODES:
        changed = file.changed(f"reduction.modes={modes}", f"stress.places.drawn.point={point}")
        balance = modelling.build(changed, Progress()).balance
        solution = newton.solve_from_rest(balance, omega)
        if not solution.converged or balance.stress is None:
            raise SolverFailure(f"{drawn.family} with {modes} modes: {solution.outcome}")
        cycle = quantity.SolvedCycle.of(balance, solution.state, settings.OUTPUT)
        largest = balance.stress.of_state(balance, solution.state).largest[regular].max()
        values.append([quantity.load("stress").value(cycle), largest])
    return f"{drawn.family} {number}", np.array(values)


def as_text(rows: list[Row]) -> str:
    """The largest changes, and how many errors hold."""
    lines = [f"{len(rows)} scenes, largest change of the stress to that with {MODES[-1]} modes:"]
    for column, what in enumerate(("at a place", "of the part")):
        changes = np.max([change[:3, column] for _, change, _ in rows], axis=0)
        lines.append(f"{what}: " + ", ".join(f"{m} modes {c:.1e}" for m, c in zip(MODES, changes, strict=False)))
    held = np.array([change[:2] <= stated for _, change, stated in rows])
    return "\n".join([*lines, f"{held.sum()} of {held.size} errors stated by twice the modes hold"])

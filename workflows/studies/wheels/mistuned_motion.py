"""How every blade of a wheel whose blades differ moves, at every node: for pictures and films of the whole wheel."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.workflows.pictures import film
from tribodyn.workflows.pictures.render_wheel import MistunedWheelFilm, Wheel, WheelState
from tribodyn.workflows.run.description import part_mesh
from tribodyn.workflows.studies.wheels.mistuned_wear import MistunedWear
from tribodyn.workflows.studies.wheels.patterns import OUTPUT, Blades, amplitude, asked_of, drawn

IMAGES = 32  # of a film


def at_peak(blades: Blades, number: int) -> WheelState:
    """The wheel of a pattern at its highest peak; raises SolveFailed."""
    pattern = drawn(asked_of(blades.file), blades.wheel.n_sectors, number)
    found, blade = blades.peak(pattern)
    balance, state = blades.balance(pattern), found.state
    names = list(balance.compliance.output_names)
    rows = [names.index(f"{OUTPUT}@{n}") for n in range(blades.wheel.n_sectors)]
    heights = amplitude(found.response[rows])
    over = heights.max() / blades.alike.amplitude
    label = f"pattern {number}, {state.omega / (2 * np.pi):.4g} Hz: blade {blade}, {over:.3f} of blades alike"
    force = state.cycle.force.reshape(state.flat.shape)
    return WheelState(label, _nodes(blades, balance, state.flat, force, state.omega), heights, np.zeros(len(heights)))


def worn_states(blades: Blades, found: MistunedWear) -> list[WheelState]:
    """A worn wheel at its first and at its last wear step."""
    history = found.history
    balance = blades.balance(drawn(asked_of(blades.file), blades.wheel.n_sectors, found.number))
    states = []
    for row in (0, -1):
        omega = float(history.omega[row])
        moved = _nodes(blades, balance, history.displacement[row], history.force[row], omega)
        label = f"pattern {found.number}, {history.cycles[row]:.3g} cycles, {omega / (2 * np.pi):.4g} Hz"
        states.append(WheelState(label, moved, found.heights[row], found.volume[row]))
    return states


def write(blades: Blades, states: Sequence[WheelState], folder: Path, formats: Sequence[str] = ()) -> list[Path]:
    """Write mistuned_wheel.png, and a film over one cycle in some formats; returns their paths.

    Raises  ValueError for a part that has no mesh of one kind; RenderingUnavailable
    """
    mesh, info = part_mesh(blades.part), blades.file.mesh_scene.wheel
    assert info is not None
    if mesh is None:
        raise ValueError("this part has bodies of different elements: its wheel cannot be drawn")
    wheel = Wheel(info.sectors, info.engine_order, np.array(info.axis, float))
    harmonics = blades.wheel.wave.basis.harmonics
    made = MistunedWheelFilm(blades.file.name, wheel, mesh, harmonics, states, IMAGES if formats else 1)
    folder.mkdir(parents=True, exist_ok=True)
    made.figure.savefig(drawing := folder / f"{made.name}.png")
    films = film.encode(film.drawn(made), folder / made.name, formats) if formats else []
    return [drawing, *films]


def _nodes(
    blades: Blades, balance: HarmonicBalance, displacement: np.ndarray, force: np.ndarray, omega: float
) -> np.ndarray:
    """Displacement (N, n_node, 3, n_coeff) of every blade [m]."""
    full = blades.wheel.full_displacement(blades.reduced, balance, displacement, force, omega)
    return np.stack([blades.part.field(one) for one in full])

"""How every blade of a wheel whose blades differ moves, at every node: for pictures and films of the whole wheel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import film
from tribodyn.workflows.pictures.render_wheel import MistunedWheelFilm, WheelState
from tribodyn.workflows.result.facts import Around
from tribodyn.workflows.run.description import part_mesh
from tribodyn.workflows.scene.source import Overrides, Source, read_scene
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels.patterns import OUTPUT, Blades, amplitude

IMAGES = 32  # of a film


@dataclass(frozen=True, repr=False)
class PatternMotion(StudyResult):
    """The wheel of a pattern of blades that differ, at its highest peak."""

    blades: Blades
    number: int
    state: WheelState
    formats: tuple[str, ...]

    def record(self) -> dict[str, object]:
        """For machines."""
        return {"pattern": self.number, "amplitude_m": self.state.heights.tolist()}

    def lines(self) -> list[str]:
        """For people."""
        return [self.state.label]

    def write(self, folder: Path) -> list[Path]:
        """Write mistuned_wheel.png, and films; raises RenderingUnavailable."""
        return write_wheel(self.blades, [self.state], folder, self.formats)


def pattern_motion(
    scene: Source, pattern: int, *, formats: Sequence[str] = (), overrides: Overrides = ()
) -> PatternMotion:
    """Draw the wheel of a pattern of blades that differ at its highest peak, all blades at one instant.

    scene : name of a scene with [wheel] and [mistuning], or a .toml file
    pattern : number of the pattern, from 1
    formats : formats of a film, gif or mp4: made over one cycle, none by default
    Raises  SceneError; SolveFailed
    """
    blades = Blades.of(read_scene(scene, overrides))
    drawn = blades.pattern(pattern)
    found, blade = blades.peak(drawn)
    balance, state = blades.balance(drawn), found.state
    names = list(balance.compliance.output_names)
    rows = [names.index(f"{OUTPUT}@{n}") for n in range(blades.wheel.n_sectors)]
    heights = amplitude(found.response[rows])
    over = heights.max() / blades.alike.amplitude
    label = f"pattern {pattern}, {state.omega / (2 * np.pi):.4g} Hz: blade {blade}, {over:.3f} of blades alike"
    force = state.cycle.force.reshape(state.flat.shape)
    moved = nodes(blades, balance, state.flat, force, state.omega)
    return PatternMotion(blades, pattern, WheelState(label, moved, heights, np.zeros(len(heights))), tuple(formats))


def write_wheel(blades: Blades, states: Sequence[WheelState], folder: Path, formats: Sequence[str] = ()) -> list[Path]:
    """Write mistuned_wheel.png, and a film over one cycle in some formats; returns their paths.

    Raises  ValueError for a part that has no mesh of one kind; RenderingUnavailable
    """
    mesh, info = part_mesh(blades.part), blades.file.mesh_scene.wheel
    assert info is not None
    if mesh is None:
        raise Refusal("this part has bodies of different elements: its wheel cannot be drawn")
    wheel = Around(info.sectors, info.engine_order, np.array(info.axis, float))
    harmonics = blades.wheel.wave.basis.harmonics
    made = MistunedWheelFilm(blades.file.name, wheel, mesh, harmonics, states, IMAGES if formats else 1)
    folder.mkdir(parents=True, exist_ok=True)
    made.figure.savefig(drawing := folder / f"{made.name}.png")
    films = film.encode(film.drawn(made), folder / made.name, formats) if formats else []
    return [drawing, *films]


def nodes(
    blades: Blades, balance: HarmonicBalance, displacement: np.ndarray, force: np.ndarray, omega: float
) -> np.ndarray:
    """Displacement (N, n_node, 3, n_coeff) of every blade [m]."""
    full = blades.wheel.full_displacement(blades.reduced, balance, displacement, force, omega)
    return np.stack([blades.part.field(one) for one in full])

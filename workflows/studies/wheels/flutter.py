"""Flutter of a scene's wheel: eigenvalues by nodal diameter in the flow, and limit cycles by friction."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.limit_cycles import LimitCycle, in_time, limit_cycles
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions
from tribodyn.hbm.threads import limited
from tribodyn.hbm.time.stepper import IntegrationFailed, Options
from tribodyn.reduction.flow import Flow, aeroelastic, with_flow
from tribodyn.reduction.wave_model import travelling_wave
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, GREY, RED
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.fields import Length
from tribodyn.workflows.scene.scene_file import Overrides, SceneError, SceneFile, Source, read_scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels import wheel_model as wheels

MARCH = Options(steps=128, accelerate=False, max_periods=50)  # of a limit cycle: docs/theory/flutter.md


@dataclass(frozen=True, repr=False)
class Flutter(StudyResult):
    """What a flow does to a wheel.

    eigenvalues : index of the wave, above 0 with the rotation -> eigenvalue with contacts stuck [1/s]
    cycles : index of a wave that flutters -> its limit cycles, and why there may be others, or none"""

    name: str
    eigenvalues: dict[int, complex]
    cycles: dict[int, tuple[list[LimitCycle], str]]

    @property
    def damping(self) -> dict[int, float]:
        """Damping ratio of every wave, structural and aerodynamic."""
        return {index: -value.real / abs(value) for index, value in self.eigenvalues.items()}

    def record(self) -> dict[str, Any]:
        return {
            "waves": [
                {"index": j, "hz": value.imag / (2 * np.pi), "damping": self.damping[j]}
                for j, value in self.eigenvalues.items()
            ],
            "limit_cycles": [
                {"index": j, "m": c.amplitude, "hz": c.frequency, "moved": c.moved, "growth": c.growth}
                for j, (cycles, _) in self.cycles.items()
                for c in cycles
            ],
            "not_found": {str(j): reason for j, (_, reason) in self.cycles.items() if reason},
        }

    def lines(self) -> list[str]:
        texts = [
            f"wave {j:3}: {value.imag / (2 * np.pi):.6g} Hz, damping {self.damping[j]:+.4%}"
            + (", flutters" if value.real > 0 else "")
            for j, value in self.eigenvalues.items()
        ]
        for j, (cycles, reason) in self.cycles.items():
            texts += [
                f"limit cycle of wave {j}: {c.amplitude:.4g} m at {c.frequency:.6g} Hz{_in_time(c)}" for c in cycles
            ]
            if reason:
                texts.append(f"limit cycles of wave {j}: {reason}")
        return texts

    def write(self, folder: Path) -> list[Path]:
        """Write flutter.csv, index, frequency and damping ratio of every wave, and flutter.png."""
        columns = {
            "index": list(self.eigenvalues),
            "frequency_Hz": [value.imag / (2 * np.pi) for value in self.eigenvalues.values()],
            "damping": list(self.damping.values()),
        }
        return write_files(folder, {"flutter": columns}, lambda: {"flutter": self.plot()})

    def plot(self) -> Figure:
        """Damping ratio of every wave; those that flutter in red."""
        index, damping = np.array(list(self.damping)), 100 * np.array(list(self.damping.values()))
        with axes_of(7.0, 4.0) as (figure, axes):
            axes.bar(index, damping, color=[RED if value < 0 else BLUE for value in damping])
            axes.axhline(0.0, color=GREY, lw=0.8)
            axes.set(xlabel="wave (positive with the rotation)", ylabel="damping ratio / %")
            axes.set_title(f"{self.name}: waves of the stuck wheel in the flow")
        return figure


def flutter(
    scene: Source,
    start: Length | None = None,
    stop: Length | None = None,
    *,
    points: int = 40,
    overrides: Overrides = (),
) -> Flutter:
    """Tell which waves of a wheel flutter in the flow of the scene, and at which amplitude friction limits them.

    scene : name of a scene with [wheel] and [flow], or a .toml file; its harmonic loads play no part
    start : amplitude of the response from which limit cycles are looked for, such as 1um; none by default
    stop : amplitude up to which they are looked for
    points : points of the backbone between these amplitudes
    Raises  SceneError for a scene without [wheel] or [flow]; Refusal where one end alone is given"""
    file = read_scene(scene, overrides)
    return of_scene(file, start, stop, points)


def of_scene(file: SceneFile, start: float | None = None, stop: float | None = None, points: int = 40) -> Flutter:
    """The flutter of the wheel of a scene that was read; arguments as for `flutter`."""
    scene = file.mesh_scene
    if (start is None) != (stop is None):
        raise Refusal("--from and --to: give both amplitudes, or none")
    with limited(scene.solver.threads):
        wheel = wheels.build(file)
        flow = flow_of(wheel)
        calm = modelling.damped(scene, travelling_wave(wheel.reduced, 1))
        eigenvalues = aeroelastic(calm, wheel.springs, flow)
        cycles: dict[int, tuple[list[LimitCycle], str]] = {}
        for index, value in sorted(eigenvalues.items(), key=lambda item: -item[1].real):
            if start is None or stop is None or value.real <= 0:
                break
            options = BackboneOptions(points, newton=settings.newton_options(scene))
            balance, reason = in_flow(wheel, index), ""
            waves: list[LimitCycle] = []
            try:
                waves, reason = limit_cycles(balance, start, stop, None, OUTPUT, options)
                waves = [in_time(balance, wave, OUTPUT, MARCH) for wave in waves]
            except (Refusal, IntegrationFailed) as error:
                reason = f"{reason}; whether time keeps them is not known: {error}" if waves else str(error)
            cycles[index] = waves, reason
    return Flutter(file.name, eigenvalues, cycles)


def _in_time(cycle: LimitCycle) -> str:
    if cycle.is_stable is None:
        return ""
    neighbour = (
        "what is beside it dies away" if cycle.is_stable else f"what is beside it grows by {cycle.growth:.2%} a period"
    )
    return f"; in time its amplitude moves by {cycle.moved:+.2%} and {neighbour}"


def flow_of(wheel: wheels.Wheel) -> Flow:
    """The flow of the scene of a wheel; raises SceneError for a scene without [flow]."""
    table = wheel.scene.flow
    if table is None:
        raise SceneError(f"{wheel.file.name} has no [flow]: give its influence coefficients")
    return Flow(table.coefficients(wheel.n_sectors), table.mode)


def in_flow(wheel: wheels.Wheel, index: int) -> HarmonicBalance:
    """The balance of the wave of an index with the forces of the flow of its scene."""
    scene = wheel.scene_for(index)
    wave = with_flow(modelling.damped(scene, travelling_wave(wheel.reduced, index)), wheel.springs, flow_of(wheel))
    return modelling.make_model(scene, wheel.part, wave).balance

"""The modes of a wheel as tables and pictures: nodal diameters, SAFE and Campbell diagrams."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.hbm.threads import limited
from tribodyn.reduction.wave_model import Crossing, Crossings, harmonic_index
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import wheel_diagrams
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.wheel_diagrams import AGAINST, safe
from tribodyn.workflows.run.sanity_checks import TYPICAL
from tribodyn.workflows.scene.fields import Frequency
from tribodyn.workflows.scene.scene_file import Overrides, Source, read_scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels.wheel_model import build, campbell, crossings, waves_over_speeds

FAMILIES = 3  # of a Campbell diagram, where more cross each other


@dataclass(frozen=True, repr=False)
class WheelModes(StudyResult):
    """Modes of a wheel with its contact free and stuck.

    families : "free" and "stuck" (n_diameter, family) [Hz], at the scene's speed; slow, fast : range of speeds [Hz]
    fastest : the same at the highest one, empty where no range is given, as all that follows
    speeds : (n_speed,) of the Campbell diagram [Hz]; waves : "free" and "stuck" (n_speed, n_order, family) [Hz]
    critical : where its orders meet these from rest on; met : modes that orders up to the number of sectors, which
        stand in space, meet in the range; line_error : relative, of frequencies between the speeds of a stress
    formats : of the pictures"""

    name: str
    n_sectors: int
    families: dict[str, np.ndarray]
    slow: float
    fast: float
    orders: tuple[int, ...]
    fastest: dict[str, np.ndarray] = field(default_factory=dict)
    speeds: np.ndarray = field(default_factory=lambda: np.zeros(0))
    waves: dict[str, np.ndarray] = field(default_factory=dict)
    critical: Crossings = field(default_factory=dict)
    met: Crossings = field(default_factory=dict)
    line_error: float = 0.0
    formats: tuple[str, ...] = ("png",)

    def figures(self) -> dict[str, Figure]:
        """The pictures by name."""
        figures = {"nodal_diameters": wheel_diagrams.nodal_diameters(self.families, self.name)}
        if self.fastest:
            figures["safe"] = safe(self.fastest, self.n_sectors, self.slow, self.fast, self.name, self.met)
            figures["campbell"] = wheel_diagrams.campbell(
                self.speeds, self.waves, self.orders, self.critical, self.name
            )
        return figures

    def record(self) -> dict[str, Any]:
        return {
            "sectors": self.n_sectors,
            "families_hz": {state: values.tolist() for state, values in self.families.items()},
            "met": {state: [asdict(m) for m in of] for state, of in self.met.items()},
            "critical": {state: [asdict(m) for m in of] for state, of in self.critical.items()},
        }

    def lines(self) -> list[str]:
        texts = []
        for state, values in self.families.items():
            if np.isnan(values).all():
                texts.append(f"contact {state}: rotation carries away what only the contact holds")
                continue
            low, high = values[:, 0].min(), values[:, 0].max()
            texts.append(f"first family, contact {state}: {low:.6g} to {high:.6g} Hz")
        for state, crossing in self.met.items():
            for order in sorted({m.engine_order for m in crossing}, key=abs):
                of_order = [m for m in crossing if m.engine_order == order]
                each = [f"family {m.family + 1} at {60 * m.speed:.5g} rpm, {m.frequency:.5g} Hz" for m in of_order]
                where = f"engine order {order}, nodal diameter {of_order[0].diameter}, contact {state}"
                texts.append(f"{where}: {', '.join(each)}")
        for state, crossing in self.critical.items():
            for order in self.orders:
                rpm = ", ".join(f"{60 * m.speed:.0f}" for m in crossing if m.engine_order == order)
                at = f"critical at {rpm} rpm" if rpm else "no critical speed"
                texts.append(f"engine order {order}, contact {state}: {at}")
        if self.line_error > TYPICAL.line_error:
            texts.append(
                f"warning: its stress changes abruptly along the speed: frequencies hold to {self.line_error:.1e}"
            )
        return texts

    def write(self, folder: Path) -> list[Path]:
        """Write nodal_diameters.csv, campbell.csv, the speeds at which modes are met as safe.csv, and the pictures."""
        columns = {"nodal_diameter": np.arange(len(self.families["stuck"]))}
        for state, values in self.families.items():
            columns |= {f"{_named(state)}_{i + 1}_Hz": values[:, i] for i in range(values.shape[1])}
        tables: dict[str, dict[str, Any]] = {"nodal_diameters": columns}
        if self.fastest:
            tables["campbell"] = {"speed_rpm": 60 * self.speeds} | {
                f"{_named(state)}_order_{order}_{i + 1}_Hz": values[:, k, i]
                for state, values in self.waves.items()
                for k, order in enumerate(self.orders)
                for i in range(values.shape[2])
            }
            rows = [
                {"contact": state, **asdict(m), "family": m.family + 1} for state, of in self.met.items() for m in of
            ]
            units = {"speed": "speed_Hz", "frequency": "frequency_Hz"}
            names = ("contact", *(each.name for each in fields(Crossing)))
            tables["safe"] = {units.get(name, name): [row[name] for row in rows] for name in names}
        return write_files(folder, tables, self.figures, self.formats)


def _named(state: str) -> str:
    """A state of the contact in the name of a column."""
    return state.replace(", ", "_")


def modes(
    scene: Source,
    start: Frequency | None = None,
    stop: Frequency | None = None,
    *,
    orders: Sequence[int] = (),
    families: int = 4,
    speeds: int = 7,
    formats: Sequence[str] = ("png",),
    overrides: Overrides = (),
) -> WheelModes:
    """Show the modes of a wheel: nodal diameters, and SAFE and Campbell diagrams of a range of speeds.

    Contact free and stuck: nodal diameters at the scene's speed, the other two diagrams at each speed of their range.

    scene : name of a scene with a [wheel], or a .toml file
    start : lowest speed of the SAFE diagram, such as 3000rpm; rest by default
    stop : highest speed of the SAFE and Campbell diagrams; no such diagrams by default
    orders : engine orders of the Campbell diagram; that of the scene by default
    families : modes of each nodal diameter
    speeds : speeds of the Campbell diagram, from rest to the highest
    formats : formats of the pictures, png, pdf or svg; can be repeated
    Raises  SceneError for a scene without a wheel; Refusal for what cannot be"""
    slow, fast = start or 0.0, stop or 0.0
    if families < 1:
        raise Refusal(f"--families {families}: ask for 1 at least")
    if (start is not None or stop is not None) and not 0 <= slow < fast:
        raise Refusal("--from and --to: give speeds from 0 on, the lower one first, and the highest one in any case")
    if speeds < 2:
        raise Refusal(f"--speeds {speeds}: a Campbell diagram needs 2 at least")
    if 0 in orders:
        raise Refusal("--order: engine orders are 1 or more, or -1 or less for waves against the rotation")
    file = read_scene(scene, overrides)
    with limited(file.scene.solver.threads):
        wheel = build(file)
        n, turns = wheel.n_sectors, wheel.full.system.gyroscopic is not None
        diameters = range(n // 2 + 1)
        ways = {"": 1, AGAINST: -1} if turns else {"": 1}
        diagrams = {
            state + way: wheel.diagram([sign * d for d in diameters], families, state == "stuck")
            for way, sign in ways.items()
            for state in ("free", "stuck")
        }
        chosen = tuple(orders) or (wheel.table.engine_order or 1,)
        if not fast:
            return WheelModes(file.name, n, diagrams, slow, fast, chosen, formats=tuple(formats))
        waves, error = waves_over_speeds(wheel, fast, [*diameters, *(-d for d in diameters)], families)
        if wheel.table.coriolis:
            chosen = tuple(dict.fromkeys((*chosen, *(-order for order in chosen))))
        turning, each, critical = campbell(wheel, fast, speeds, chosen, min(families, FAMILIES), waves)
        fastest = {
            state + way: np.array([of[harmonic_index(sign * d, n)](fast) for d in diameters])
            for way, sign in {"": 1, AGAINST: -1}.items()
            for state, of in waves.items()
            if wheel.table.coriolis or not way
        }
        met = crossings(waves, n, range(-1, -n - 1, -1), slow, fast)
    return WheelModes(
        file.name, n, diagrams, slow, fast, chosen, fastest, turning, each, critical, met, error, tuple(formats)
    )

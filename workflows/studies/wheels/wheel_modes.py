"""The modes of a wheel as tables and pictures: nodal diameters, SAFE and Campbell diagrams."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.hbm.threads import limited
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import wheel_diagrams
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.wheel_diagrams import AGAINST
from tribodyn.workflows.scene.fields import Frequency
from tribodyn.workflows.scene.scene_file import Overrides, Source, read_scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels.wheel_model import build, campbell, critical_speeds

FAMILIES = 3  # of a Campbell diagram, where more cross each other


@dataclass(frozen=True, repr=False)
class WheelModes(StudyResult):
    """Modes of a wheel with its contact free and stuck.

    families : "free" and "stuck" (n_diameter, family) [Hz]; slow, fast : range of speeds [Hz], None for none
    speeds : (n_speed,) of the Campbell diagram [Hz]; waves : "free" and "stuck" (n_speed, n_order, family) [Hz]
    formats : of the pictures"""

    name: str
    n_sectors: int
    families: dict[str, np.ndarray]
    slow: float | None
    fast: float | None
    orders: tuple[int, ...]
    speeds: np.ndarray
    waves: dict[str, np.ndarray]
    formats: tuple[str, ...] = ("png",)

    @property
    def critical(self) -> dict[int, list[float]]:
        """Engine order -> speeds [Hz] at which it meets its stuck frequencies."""
        if not len(self.speeds):
            return {}
        stuck = self.waves["stuck"]
        return {
            order: sorted(at for family in stuck[:, i].T for at in critical_speeds(self.speeds, family, order))
            for i, order in enumerate(self.orders)
        }

    def meetings(self) -> dict[str, list[wheel_diagrams.Crossing]]:
        """Modes that engine orders meet in the range of speeds, by the state of the contact."""
        if self.slow is None or self.fast is None:
            return {}
        return wheel_diagrams.meetings(self.families, self.n_sectors, self.slow, self.fast)

    def figures(self) -> dict[str, Figure]:
        """The pictures by name."""
        figures = {"nodal_diameters": wheel_diagrams.nodal_diameters(self.families, self.name)}
        if self.slow is not None and self.fast is not None:
            figures["safe"] = wheel_diagrams.safe(self.families, self.n_sectors, self.slow, self.fast, self.name)
        if len(self.speeds):
            figures["campbell"] = wheel_diagrams.campbell(
                self.speeds, self.waves, self.orders, self.critical, self.name
            )
        return figures

    def record(self) -> dict[str, Any]:
        """What was found, for machines."""
        return {
            "sectors": self.n_sectors,
            "families_hz": {state: values.tolist() for state, values in self.families.items()},
            "met": {state: [asdict(m) for m in crossing] for state, crossing in self.meetings().items()},
            "critical_hz": {str(order): at for order, at in self.critical.items()},
        }

    def lines(self) -> list[str]:
        """What was found, for people."""
        texts = []
        for state, values in self.families.items():
            if np.isnan(values).all():
                texts.append(f"contact {state}: rotation carries away what only the contact holds")
                continue
            low, high = values[:, 0].min(), values[:, 0].max()
            texts.append(f"first family, contact {state}: {low:.6g} to {high:.6g} Hz")
        for state, crossing in self.meetings().items():
            for order in sorted({m.engine_order for m in crossing}):
                of_order = [m for m in crossing if m.engine_order == order]
                each = [f"family {m.family + 1} at {60 * m.speed:.5g} rpm, {m.frequency:.5g} Hz" for m in of_order]
                where = f"by modes at the scene's speed engine order {order}, {of_order[0].diameter} diameters, {state}"
                texts.append(f"{where}: {', '.join(each)}")
        for order, at in self.critical.items():
            texts.append(
                f"engine order {order}: critical at {', '.join(f'{60 * s:.0f}' for s in at) or 'no'} rpm, stuck"
            )
        return texts

    def write(self, folder: Path) -> list[Path]:
        """Write nodal_diameters.csv and the pictures."""
        columns = {"nodal_diameter": np.arange(len(self.families["stuck"]))}
        for state, values in self.families.items():
            columns |= {f"{state.replace(', ', '_')}_{i + 1}_Hz": values[:, i] for i in range(values.shape[1])}
        return write_files(folder, {"nodal_diameters": columns}, self.figures(), self.formats)


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

    Contact free and stuck, at the scene's speed; the Campbell diagram has the modes at each speed.

    scene : name of a scene with a [wheel], or a .toml file
    start : lowest speed of the SAFE diagram, such as 3000rpm
    stop : highest speed of the SAFE diagram, and of the Campbell diagram; no such diagrams by default
    orders : engine orders of the Campbell diagram; that of the scene by default
    families : modes of each nodal diameter
    speeds : speeds of the Campbell diagram, from rest to the highest
    formats : formats of the pictures, png, pdf or svg; can be repeated
    Raises  SceneError for a scene without a wheel; Refusal for what cannot be"""
    slow, fast = start, stop
    if families < 1:
        raise Refusal(f"--families {families}: ask for 1 at least")
    if (slow is not None and fast is None) or (
        fast is not None and not (fast > 0 and (slow is None or 0 < slow < fast))
    ):
        raise Refusal("--from and --to: give speeds above 0, the lower one first, the highest one in any case")
    if speeds < 2:
        raise Refusal(f"--speeds {speeds}: a Campbell diagram needs 2 at least")
    if 0 in orders:
        raise Refusal("--order: engine orders are 1 or more, or -1 or less for waves against the rotation")
    file = read_scene(scene, overrides)
    with limited(file.scene.solver.threads):
        wheel = build(file)
        diameters = range(wheel.n_sectors // 2 + 1)
        turns = wheel.full.system.gyroscopic is not None
        diagrams = {
            state + way: wheel.diagram([sign * d for d in diameters], families, state == "stuck")
            for way, sign in {"": 1, **({AGAINST: -1} if turns else {})}.items()
            for state in ("free", "stuck")
        }
        chosen = tuple(orders) or (wheel.table.engine_order or 1,)
        turning, waves = np.zeros(0), dict[str, np.ndarray]()
        if fast is not None:
            shown = chosen + (tuple(-order for order in chosen) if turns else ())
            turning, each = campbell(wheel, fast, speeds, shown, min(families, FAMILIES))
            waves = {state: rows[:, : len(chosen)] for state, rows in each.items()}
            if turns:
                waves["stuck" + AGAINST] = each["stuck"][:, len(chosen) :]
    return WheelModes(file.name, wheel.n_sectors, diagrams, slow, fast, chosen, turning, waves, tuple(formats))

"""What moves the life of the fretting rig: ./tribodyn prove rig life.

Damping, faces and the reading of the harmonics are ours, the life and the friction work are measured. Each is changed
alone, the platform set again to the published preload, and the rig worn until its preload at rest is lost. The work is
the worn volume over the wear coefficient, the volume what 31 N interfere times the face that wears, and the life that
work over the energy of a cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

from threadpoolctl import threadpool_limits

from proof.cases.rig.fit import fit_height
from proof.cases.rig.model import NoSolution, Rig
from proof.cases.rig.published import LIFE_MEASURED, PRELOAD, TABLE_5_3, WORK
from proof.cases.rig.wear import wear_down
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.measured.compare import changed

CLOSE = 1e-6  # of the published preload, to which that of a changed rig is set
LOST = "lost"
TRUE_FACE = "; ".join((
    "geometry.contact_length=1.56 mm",
    'contact.punch=["5 mm", "1.56 mm"]',
    'surfaces.synthetic.size=["1.56 mm", "5 mm"]',
))  # fmt: skip
CHANGES: tuple[str, ...] = (
    "damping.modal=1.3 %",
    "damping.modal=5.2 %",
    "harmonics.kept=[0, 1]",
    "harmonics.kept=[0, 1, 2]",
    "harmonics.kept=[0, 1, 2, 3, 4, 5]",
    "surfaces.synthetic.ridge=0 um",
    "surfaces.synthetic.ridge=12 um",
    TRUE_FACE,
    f"harmonics.kept=[0, 1, 2]; {TRUE_FACE}",
    "springs.nut.stiffness=4e8 N/m",
    "contact.friction=0.6",
    "loads.harmonic.shaker.value=60 N",
    "wear.at=285 Hz",
    "wear.at=295 Hz",
)
"""Numbers of the scene that are ours, other readings of the text (harmonics 0 to 2, the true face of 7.8 mm2), and
published numbers as far as a test could miss them."""


@dataclass(frozen=True)
class Life:
    """The rig with one change.

    change : overrides, joined by "; ", none for the scene; height : of the platform at the published preload [m]
    energy : per cycle [J] and sliding : range of the mean sliding displacement [m], both of the unworn contact
    cycles, work : until the preload at rest is lost, friction work in J; depth : mean worn depth then [m]
    outcome : LOST, or why there is no life
    """

    change: str
    height: float | None
    energy: float | None
    sliding: float | None
    cycles: float | None
    work: float | None
    depth: float | None
    outcome: str


def run(scene: str, overrides: Sequence[str], changes: Sequence[str], tell: Callable[[str], None]) -> list[Life]:
    """A scene of the rig with `overrides`, and with each of the changes beside.

    scene : name or path; changes : each one or several overrides, joined by ";", CHANGES where empty
    tell : as `rig_wear.wear_down`
    Raises  ValueError for a change that the scene does not know, before anything is computed
    """
    rows = []
    with threadpool_limits(1):
        for change, file in changed(scene, overrides, changes or CHANGES).items():
            tell(change or "the scene")
            rows.append(_row(change, file, tell))
    return rows


def _row(change: str, file: SceneFile, tell: Callable[[str], None]) -> Life:
    try:
        rig = _pressed(Rig.of(file))
        cycle = rig.cycle()
        worn = wear_down(rig, 0.0, tell)
    except NoSolution as error:
        return Life(change, *(None,) * 6, outcome=str(error))
    if not worn.lost:
        return Life(change, rig.height, cycle.energy, 2 * cycle.slip, None, None, None, worn.end)
    depth = worn.volume[-1] / worn.area.sum()
    lost = float(worn.history.cycles[-1]), float(worn.spent[-1]), float(depth)
    return Life(change, rig.height, cycle.energy, 2 * cycle.slip, *lost, LOST)


def _pressed(rig: Rig) -> Rig:
    """The rig with its platform at the height of the published preload; raises NoSolution where there is none."""
    result = fit_height(rig)
    if abs(result.after[0] / PRELOAD - 1) > CLOSE:
        raise NoSolution(
            f"no height of the platform that is looked at makes {PRELOAD:.3g} N of preload, the nearest makes "
            f"{result.after[0]:.3g} N"
        )
    return rig.with_height(result.named()["platform"])


def as_text(rows: Sequence[Life]) -> str:
    """A table, below the experiment; lives and works of changes with their difference from the scene's."""
    scene, (energy, sliding) = rows[0], TABLE_5_3[70.0]
    measured = Life("experiment at 70 N", None, energy, sliding, LIFE_MEASURED, WORK, None, LOST)
    lines = [" million cycles  friction work, kJ  depth, um  uJ a cycle  sliding, um  platform, um  change"]
    for row in (measured, *rows):
        numbers = (
            _beside(row.cycles, scene.cycles, 1e-6, row in rows[1:]).rjust(15),
            _beside(row.work, scene.work, 1e-3, row in rows[1:]).rjust(18),
            _number(row.depth, 1e6).rjust(10),
            _number(row.energy, 1e6).rjust(11),
            _number(row.sliding, 1e6).rjust(12),
            _number(row.height, 1e6).rjust(13),
        )
        reason = "" if row.outcome == LOST else f": {row.outcome}"
        lines.append(" ".join(numbers) + f"  {row.change or 'the scene'}{reason}")
    return "\n".join(lines)


def _number(value: float | None, factor: float) -> str:
    return "" if value is None else f"{value * factor:.4g}"


def _beside(value: float | None, other: float | None, factor: float, changed: bool) -> str:
    """A number, and for a change its difference from the scene's."""
    if value is None or other is None or not changed:
        return _number(value, factor)
    return f"{value * factor:.4g} ({100 * (value / other - 1):+.0f} %)"


def as_records(rows: Sequence[Life]) -> list[dict[str, object]]:
    """For machines, SI units."""
    return [asdict(row) for row in rows]

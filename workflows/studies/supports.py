"""Impact wear at the supports of a part: pins, stops and hangers that a scene models as springs.

A support rubs on its seat and strikes it. The work that the part puts into its spring per cycle, before the spring
gives it back, is what an impact wear law takes; the wear of the seat does not change the motion, so that it follows
from a response that is already computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear.laws.impact import loading_work
from tribodyn.refusal import Refusal
from tribodyn.workflows.result.store import Held, held
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import quantity
from tribodyn.workflows.scene.schema import MeshScene, Scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult

SAMPLES = 256  # of a cycle, at the least


def supports_of(scene: Scene) -> dict[str, tuple[float, str]]:
    """Springs of a scene to the ground whose group and direction some output has: stiffness [N/m] and output by name.

    Raises  ValueError, naming the table that is missing, where there is none
    """
    springs = scene.springs if isinstance(scene, MeshScene) else {}
    grounded = {name: spring for name, spring in springs.items() if spring.opposite is None}
    if not isinstance(scene, MeshScene) or not grounded:
        raise Refusal("the scene has no spring to the ground: a support is a table such as [springs.left_pin]")
    outputs = {"response": scene.response, **scene.response.others}
    found = {
        name: (spring.stiffness, output)
        for name, spring in grounded.items()
        for output, seen in outputs.items()
        if seen.group == spring.group and seen.direction == spring.direction
    }
    if not found:
        first, spring = next(iter(grounded.items()))
        raise Refusal(
            f"no output observes a support: add [response.others.{first}] with the group and direction of its spring, "
            f'group = "{spring.group}"'
        )
    return found


def support_work(basis: HarmonicBasis, displacement: np.ndarray, stiffness: float) -> np.ndarray:
    """Work per cycle (...) that a motion puts into a spring while it stretches it [J].

    displacement : (..., n_coeff) Fourier coefficients of its end [m]; stiffness : [N/m]
    A spring that never changes sign takes k z_max^2 / 2 - k z_min^2 / 2 of one swing.
    """
    z = basis.to_time(displacement)
    return np.asarray(loading_work(stiffness * z, z))


@dataclass(frozen=True, repr=False)
class Supports(StudyResult):
    """Wear at every support of a part along a response curve.

    frequency : (n_point,) [Hz]; work : support -> (n_point,) that the part puts into its spring per cycle [J]
    depth_per_work : support -> of its seat [m/J], for those whose bearing area and coefficient are given
    """

    frequency: np.ndarray
    work: Mapping[str, np.ndarray]
    depth_per_work: Mapping[str, float]

    def record(self) -> list[dict[str, Any]]:
        """For machines: every support where it takes most work."""
        rows = []
        for name, work in self.work.items():
            top, most = int(work.argmax()), float(work.max())
            depth = self.depth_per_work[name] * most if name in self.depth_per_work else None
            row = {"support": name, "hz": float(self.frequency[top]), "work_J": most, "depth_m_per_cycle": depth}
            rows.append(row)
        return rows

    def lines(self) -> list[str]:
        """For people."""
        said = []
        for row in self.record():
            depth = row["depth_m_per_cycle"]
            worn = "" if depth is None else f", {depth:.4g} m of depth"
            said.append(f"{row['support']:16} at most {row['work_J']:.4g} J per cycle{worn}, at {row['hz']:.6g} Hz")
        return said

    def write(self, folder: Path) -> list[Path]:
        """Write supports.csv: work and depth per cycle of every support over frequency."""
        work = {f"{name}_work_J": work for name, work in self.work.items()}
        depth = {f"{n}_depth_m_per_cycle": self.depth_per_work.get(n, np.nan) * work for n, work in self.work.items()}
        return write_files(folder, {"supports": {"frequency_Hz": self.frequency, **work, **depth}}, {})


def supports(
    result: Held,
    areas: Annotated[Mapping[str, float] | None, quantity("m2")] = None,
    coefficient: Annotated[float | None, quantity("m3/J")] = None,
) -> Supports:
    """Wear by impacts at the supports of a part, springs to the ground whose displacement is observed.

    result : folder or file of a result with a response curve
    areas : bearing area of a support's seat, such as "left_pin=9.8 mm2"; can be repeated
    coefficient : coefficient of impact wear, such as "2e3 um3/J"
    Raises  ValueError for a result without a response curve, supports or a spring of that name
    """
    result = held(result)
    scene = scene_file.from_json(result.provenance["scene"])
    there, areas, curve = supports_of(scene), areas or {}, result.response
    unknown = [name for name in areas if name not in there]
    if unknown:
        raise Refusal(f'no support is called "{unknown[0]}", there are {", ".join(there)}')
    if curve is None:
        raise Refusal("the result has no response curve: run its scene")
    basis = HarmonicBasis(result.harmonics, max(SAMPLES, 32 * result.harmonics[-1], scene.harmonics.samples))
    work = {
        name: support_work(basis, curve.response[:, curve.output_names.index(output)], stiffness)
        for name, (stiffness, output) in there.items()
    }
    known = {} if coefficient is None else {name: coefficient / area for name, area in areas.items()}
    return Supports(curve.frequency, work, known)

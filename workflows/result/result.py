"""What a run leaves behind: plain data. `tribodyn.plot` draws it, workflows/report/text.py puts it into words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.fatigue import StressOverCycle
from tribodyn.hbm.stability.branch_stability import BranchStability
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.workflows.result.model_facts import ModelFacts, Stage
from tribodyn.workflows.result.summary import summary
from tribodyn.workflows.result.verdict import Verdict
from tribodyn.workflows.scene.schema import MeshScene, Scene

PEAKS = 3  # of a response that does not wear, shown in pictures

SAME_PLANE = 0.95  # cosine between the normals of faces from which on they are drawn in one plane


def connected(cells: np.ndarray, n: int) -> np.ndarray:
    """(n,) number of the piece that each of n points belongs to; cells : (n_cell, n_corner) what joins them."""
    links = coo_matrix((np.ones(cells.size), (np.repeat(cells[:, 0], cells.shape[1]), cells.ravel())), shape=(n, n))
    return np.asarray(connected_components(links, directed=False)[1])


@dataclass(frozen=True)
class PartMesh:
    """The mesh of the part as pictures need it.

    kind : VTK cell type name, such as "triquadratic_hexahedron"
    points : (n_node, 3) [m]
    cells : (n_cell, n_corner) node indices in VTK order"""

    kind: str
    points: np.ndarray
    cells: np.ndarray


@dataclass(frozen=True)
class Patch:
    """The contact patch: a ContactInterface without its map to a model's coordinates.

    components : contact components in the order of the history's rows
    nodes : (n_pair,) node of the part at each pair, -1 where there is no mesh
    points, frames, area, gap, faces : as in fem.interface.ContactInterface
    free_deflection : (n_pair,) normal approach under the static loads with body 2 absent, nan without wear [m]"""

    components: tuple[str, ...]
    nodes: np.ndarray
    points: np.ndarray
    frames: np.ndarray
    area: np.ndarray
    gap: np.ndarray
    faces: np.ndarray
    free_deflection: np.ndarray

    @property
    def flat(self) -> np.ndarray:
        """(n_pair, 2) positions in the mean tangential plane, from the middle of the patch [m].

        Faces that do not look the same way are each drawn in their own plane, one above the other along t2."""
        if self.in_one_plane:
            return np.asarray((self.points - self.points.mean(0)) @ self.frames.mean(0)[:2].T)
        positions, top, of = np.zeros((len(self.points), 2)), 0.0, self.face_of
        faces = [self._alone(of == face) for face in range(of.max() + 1)]
        space = 0.2 * min(float(np.ptp(face[:, 1])) for face in faces)
        for face, points in enumerate(faces):
            points[:, 1] += top - points[:, 1].min()
            top = float(points[:, 1].max()) + space
            positions[of == face] = points
        return positions - (positions.min(axis=0) + positions.max(axis=0)) / 2

    @property
    def face_of(self) -> np.ndarray:
        """(n_pair,) number of the connected face that each pair belongs to, from 0, in the order of the pairs."""
        return connected(self.faces, len(self.points))

    @property
    def in_one_plane(self) -> bool:
        """Whether all faces look the same way, or there is one only."""
        if not len(self.faces):
            return True
        of = self.face_of
        normals = np.array([self.frames[of == face, 2].mean(axis=0) for face in range(of.max() + 1)])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return bool((normals @ normals.T).min() > SAME_PLANE)

    def _alone(self, pairs: np.ndarray) -> np.ndarray:
        """Positions of some pairs in their own mean plane."""
        points = self.points[pairs]
        return np.asarray((points - points.mean(0)) @ self.frames[pairs].mean(0)[:2].T)

    def of(self, pairs: slice) -> Patch:
        """The patch of some pairs alone, with the faces that lie between them."""
        numbers = np.arange(len(self.points))[pairs]
        number = np.full(len(self.points), -1)
        number[numbers] = np.arange(len(numbers))
        faces = number[self.faces]
        by_pair = ("nodes", "points", "frames", "area", "gap", "free_deflection")
        arrays = {name: getattr(self, name)[pairs] for name in by_pair}
        return replace(self, faces=faces[(faces >= 0).all(axis=1)], **arrays)

    def shares(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cut every face into one quadrangle for each of its corners, to show what has one value for each pair.

        points : (n_pair, d) where the pairs are drawn
        Returns (n_share, 4, d) corners of the quadrangles, and (n_share,) the pair each belongs to"""
        corner = points[self.faces]
        before, after = np.roll(corner, 1, axis=1), np.roll(corner, -1, axis=1)
        middle = np.broadcast_to(corner.mean(1, keepdims=True), corner.shape)
        share = np.stack([corner, (corner + after) / 2, middle, (corner + before) / 2], axis=2)
        return share.reshape(-1, 4, points.shape[1]), self.faces.ravel()


@dataclass(frozen=True)
class References:
    """Linear amplitudes of the observed output around the nonlinear one.

    omega : (n_reference,) [rad/s]
    free : (n_reference,) amplitude with the contact absent [m]
    stuck : (n_reference,) amplitude with every contact closed and sticking [m]"""

    omega: np.ndarray
    free: np.ndarray
    stuck: np.ndarray


@dataclass(frozen=True)
class Fields:
    """Full displacement of the part in chosen states.

    row : (n_field,) rows of the wear history, points of the response curve where nothing wears
    displacement : (n_field, n_node, 3, n_coeff) Fourier coefficients [m]"""

    row: np.ndarray
    displacement: np.ndarray


@dataclass(frozen=True)
class Stress:
    """Stress of the part in the same states as the fields.

    row : (n_field,) rows of the wear history, points of the response curve where nothing wears
    largest, utilisation, mean, amplitude, tensor : (n_field, n_node, ...) as in hbm.fatigue.StressOverCycle
    tension, watson, face_node : (n_field, n_pair) likewise
    spot, spot_point : (n_field, n_spot) nodes of the hot spots, the hottest first, (n_field, n_spot, 3) [m]
    spot_kind : (n_field, n_spot) what stands there, as numbers of fem.singularities.KINDS: other than 0 the exact
        stress is infinite"""

    row: np.ndarray
    largest: np.ndarray
    utilisation: np.ndarray
    mean: np.ndarray
    amplitude: np.ndarray
    tensor: np.ndarray
    tension: np.ndarray
    watson: np.ndarray
    face_node: np.ndarray
    spot: np.ndarray
    spot_point: np.ndarray
    spot_kind: np.ndarray

    def of(self, number: int) -> StressOverCycle | None:
        """The stress in the state of a row; None where it was not computed there."""
        at = np.flatnonzero(self.row == number)
        if not len(at):
            return None
        return StressOverCycle(**{f.name: getattr(self, f.name)[at[0]] for f in fields(StressOverCycle)})


@dataclass(frozen=True)
class Loops:
    """Periodic contact displacement and force over one cycle, in the same states as the fields.

    row : (n_field,) rows of the wear history, points of the response curve where nothing wears
    displacement, force : (n_field, n_pair, n_component, n_sample) [m], [N]"""

    row: np.ndarray
    displacement: np.ndarray
    force: np.ndarray


@dataclass(frozen=True)
class Result:
    """A run, finished or not.

    provenance : scene text and overrides, versions, seed, start time, threads; scene : that it was computed from
    facts : what was modelled and how long it took
    stage : how far the run came; `state` is its sentence
    verdict : its errors, None where none was asked for
    response : curve of the unworn contact; stability : of it, where the scene asks for it"""

    provenance: Mapping[str, str]
    scene: Scene
    facts: ModelFacts
    stage: Stage
    patch: Patch
    part: PartMesh | None = None
    references: References | None = None
    response: Branch | None = None
    stability: BranchStability | None = None
    wear: WearHistory | None = None
    fields: Fields | None = None
    stress_field: Stress | None = None
    loops: Loops | None = None
    verdict: Verdict | None = None

    def __repr__(self) -> str:
        """What it is in a few lines, without its arrays."""
        facts, curve, worn = self.facts, self.response, self.wear
        size = f"{facts.full_dofs} DOFs, {facts.model_dofs} in the model, {facts.contact_pairs} node pairs in contact"
        lines = [f"Result of {self.provenance.get('scene_name', '')}: {self.state}", f"model     {size}"]
        if curve is not None:
            first, last = np.array([curve.omega.min(), curve.omega.max()]) / (2 * np.pi)
            lines.append(f"response  {len(curve.omega)} points, {first:.4g} to {last:.4g} Hz")
        if worn is not None and len(worn.cycles):
            lines.append(f"wear      {self.wear_steps} steps, {worn.cycles[-1]:.4g} cycles")
        lines.append(f"errors    {'not stated' if self.verdict is None else 'stated, see summary()'}")
        return "\n".join(lines)

    @property
    def state(self) -> str:
        """A sentence on how far the run came."""
        if self.stage is Stage.WEARING and self.wear is not None:
            return f"{self.stage.value}: {len(self.wear.cycles)} wear steps are done"
        if self.stage is Stage.FAILED and self.wear is not None:
            return str(self.wear.end)
        if self.stage is Stage.COMPLETE and self.wear is not None:
            return f"{self.stage.value}: {self.wear.end}"
        return self.stage.value

    @property
    def finished(self) -> bool:
        """Whether the run computed everything that its scene asked for."""
        return self.stage is Stage.COMPLETE

    @property
    def harmonics(self) -> tuple[int, ...]:
        """Harmonics that it was computed with."""
        return self.facts.harmonics

    @property
    def wear_steps(self) -> int:
        """Number of wear steps taken."""
        return 0 if self.wear is None else int(np.count_nonzero(self.wear.cycles_in_step))

    def summary(self) -> dict[str, Any]:
        """The numbers of the result as plain data, see result.summary: what `tribodyn show --json` prints."""
        return summary(self)

    def shown_rows(self) -> np.ndarray:
        """What pictures show: rows of the wear history, or points of the response curve where nothing wears.

        Those of the fields; else the first, the middle and the last row, or the highest peaks of the curve"""
        if self.fields is not None:
            return self.fields.row
        if self.wear is not None and len(self.wear.cycles):
            last = len(self.wear.cycles) - 1
            return np.unique([0, last // 2, last])
        return np.zeros(0, int) if self.response is None else peaks(self.response)

    @property
    def driving_force(self) -> complex | None:
        """The one force that drives in harmonic 1, F exp(i phase) [N]; None where something else drives it too."""
        loads = list(self.scene.loads.harmonic.values())
        moves = isinstance(self.scene, MeshScene) and self.scene.motion
        if len(loads) != 1 or moves or loads[0].harmonic != 1 or not loads[0].value:
            return None
        return complex(loads[0].value * np.exp(1j * loads[0].phase))


def peaks(frf: Branch, count: int = PEAKS) -> np.ndarray:
    """Points of the highest local maxima of a curve's first output, by frequency; else the highest point."""
    height = frf.height(frf.output_names[0])
    inner = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:]) & (height[1:-1] > 0)) + 1
    best = inner[np.argsort(-height[inner])][:count] if len(inner) else np.array([frf.highest(frf.output_names[0])])
    return np.asarray(best[np.argsort(frf.omega[best])])

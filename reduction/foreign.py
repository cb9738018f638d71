"""Bring your own matrices: M, K, C from another program, with the DOFs that touch, load and observe.

`tribodyn.matrices` has them for scripts, with an example; a scene with [model] does the same without Python.
Units are SI after `scale`. A DOF is a number from 0, or (node, component) where the file carries labels (Abaqus text,
ANSYS with its mapping file); the component is 1 to 6 or a name such as "UX" or "z"."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from tribodyn.fem.interface import COMPONENTS, ContactInterface, checked_components
from tribodyn.fem.system import SecondOrderSystem, dense
from tribodyn.reduction import abaqus_matrix, harwell_boeing, matrix_files
from tribodyn.reduction.abaqus_matrix import Labels
from tribodyn.reduction.foreign_contact import component_number, frames_of_normals, interface_of_rows, sign_factors
from tribodyn.reduction.matrix_facts import MatrixFacts, matrix_facts, symmetric
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal

NAMES = {"mass": ("M", "MAA", "MAAX"), "stiffness": ("K", "KAA", "KAAX"), "damping": ("C", "BAA", "BAAX")}
"""Variables looked for in a file that holds all matrices, the first that is there."""

Dof = int | Sequence[int | str]
"""A DOF: number from 0, or (node, component)."""

Terms = Dof | Mapping[Any, float] | np.ndarray
"""A load or output: one DOF, DOF -> factor, or the vector (n,) itself."""


@dataclass(frozen=True)
class ForeignMatrices:
    """Matrices of one structure from files.

    mass, stiffness, damping : (n, n) symmetric csr [kg], [N/m], [N s/m]; damping None where there is none
    labels : (node, component 1..6) of each DOF, or None where the files carry none
    notes : what was changed on reading, one sentence each"""

    mass: sp.csr_matrix
    stiffness: sp.csr_matrix
    damping: sp.csr_matrix | None = None
    labels: Labels | None = None
    notes: tuple[str, ...] = ()

    @property
    def n_dof(self) -> int:
        """Number of DOFs n."""
        return int(self.stiffness.shape[0])

    def dof(self, dof: Dof) -> int:
        """Row of a DOF given by number or by (node, component)."""
        if isinstance(dof, int | np.integer):
            if not 0 <= dof < self.n_dof:
                raise Refusal(f"DOF {dof} is outside 0 .. {self.n_dof - 1}: DOF numbers count from 0")
            return int(dof)
        if isinstance(dof, str) or len(dof) != 2:
            raise Refusal(f"{dof!r} is no DOF: give a number from 0 or a pair (node, component)")
        if self.labels is None:
            raise Refusal(f"DOF {tuple(dof)} names a node but the files have no labels: give mapping= or numbers")
        label = (int(dof[0]), component_number(dof[1]))
        if label not in self._rows:
            raise Refusal(f"node {label[0]} has no free component {label[1]} in these matrices")
        return self._rows[label]

    @cached_property
    def _rows(self) -> dict[tuple[int, int], int]:
        return {label: row for row, label in enumerate(self.labels or ())}

    def facts(self) -> MatrixFacts:
        """What the matrices state about their structure; raises Refusal where they have no modes."""
        return matrix_facts(self.stiffness, self.mass, self.labels)

    def system(self, loads: Mapping[str, Terms], outputs: Mapping[str, Terms]) -> SecondOrderSystem:
        """The matrices with named unit loads and observed displacements, sparse: what Craig-Bampton takes."""
        return SecondOrderSystem(
            mass=self.mass,
            stiffness=self.stiffness,
            damping=self.damping,
            loads={name: self._vector(terms, f"load {name}") for name, terms in loads.items()},
            outputs={name: self._vector(terms, f"output {name}") for name, terms in outputs.items()},
        )

    def contact(
        self, body1: Sequence[Sequence[Dof]] | np.ndarray, body2: Sequence[Sequence[Dof]] | np.ndarray | None = None,
        *, area: float | np.ndarray, components: Sequence[str] = ("n",),
        normal: Sequence[float] | np.ndarray | None = None, t1: Sequence[float] | None = None,
        signs: Sequence[float] | None = None, gap: float | np.ndarray = 0.0, points: np.ndarray | None = None,
    ) -> ContactInterface:  # fmt: skip
        """The DOFs that touch, pair by pair, against each other or against the ground (body2 None).

        body1, body2 : (n_pair, n_component) DOFs that are themselves t1, t2, n as of `components`;
            with `normal`, (n_pair, 3) DOFs along x, y, z, and every pair gets its own frame
        area : whole area of the patch [m2], shared equally, or (n_pair,) tributary areas
        components : subset of t1, t2, n in this order
        normal : (3,) or (n_pair, 3) direction from body 1 into body 2
        t1 : with `normal`, (3,) direction whose part along the face is t1; the axis least along the normal if not given
        signs : without `normal`, +1 or -1 per component: -1 where body 1 closes the gap against the DOF's direction
        gap : opening before loading [m], one for all or (n_pair,)
        points : (n_pair, 3) positions for pictures [m]; all at the origin where unknown"""
        modelled = checked_components(components)
        width = len(modelled) if normal is None else 3
        first = self._table(body1, width, "body1")
        second = None if body2 is None else self._table(body2, width, "body2")
        n_pair = len(first)
        if second is not None and len(second) != n_pair:
            raise Refusal(f"body1 has {n_pair} contact nodes but body2 has {len(second)}: they meet in pairs")
        if normal is None:
            frames = np.tile(np.eye(3), (n_pair, 1, 1))
            weights = np.tile(np.diag(sign_factors(signs, len(modelled))), (n_pair, 1, 1))
        else:
            if signs is not None:
                raise Refusal("signs and normal are both given: the normal already gives what closes the gap")
            frames = frames_of_normals(normal, t1, n_pair)
            weights = frames[:, [COMPONENTS.index(name) for name in modelled]]
        rows = np.repeat(np.arange(n_pair * len(modelled)), width)
        shape = (n_pair * len(modelled), self.n_dof)

        def one_body(dofs: np.ndarray) -> sp.csr_matrix:
            columns = np.repeat(dofs[:, None], len(modelled), axis=1)
            return sp.coo_matrix((weights.ravel(), (rows, columns.ravel())), shape=shape).tocsr()

        motion = one_body(first) if second is None else one_body(first) - one_body(second)
        return interface_of_rows(motion, modelled, frames, area, gap, points)

    def contact_rows(
        self, rows: Any, components: Sequence[str], *, area: float | np.ndarray, gap: float | np.ndarray = 0.0,
        points: np.ndarray | None = None,
    ) -> ContactInterface:  # fmt: skip
        """A contact whose relative displacements are any combinations of DOFs, x = w^T q for every row w.

        rows : (n_pair * n_component, n) array or sparse matrix, pair by pair, in each the components in order
        components : subset of t1, t2, n in this order; n counts as positive where it closes
        area, gap, points : as in `contact`"""
        modelled = checked_components(components)
        motion = sp.csr_matrix(np.atleast_2d(rows) if not sp.issparse(rows) else rows, dtype=float)
        if motion.shape[1] != self.n_dof or motion.shape[0] % len(modelled) or not motion.shape[0]:
            raise Refusal(
                f"contact rows are {motion.shape[0]} x {motion.shape[1]}: give {len(modelled)} for each pair "
                f"({', '.join(modelled)}), each with a factor for every one of the {self.n_dof} DOFs"
            )
        if not np.isfinite(motion.data).all():
            raise Refusal("contact rows have entries that are not finite")
        frames = np.tile(np.eye(3), (motion.shape[0] // len(modelled), 1, 1))
        return interface_of_rows(motion, modelled, frames, area, gap, points)

    def _vector(self, terms: Terms, name: str) -> np.ndarray:
        if isinstance(terms, np.ndarray):
            if terms.shape != (self.n_dof,):
                raise Refusal(f"{name} has shape {terms.shape}: a vector of {self.n_dof} numbers is needed")
            return terms.astype(float)
        vector = np.zeros(self.n_dof)
        pairs = terms.items() if isinstance(terms, Mapping) else [(terms, 1.0)]
        for dof, factor in pairs:
            vector[self.dof(dof)] += factor
        return vector

    def _table(self, dofs: Any, width: int, name: str) -> np.ndarray:
        rows = [[self.dof(dof) for dof in row] for row in dofs]
        if not rows or any(len(row) != width for row in rows):
            raise Refusal(f"{name} needs rows of {width} DOFs, one row for each contact node")
        return np.array(rows)


def from_arrays(mass: Any, stiffness: Any, damping: Any = None, labels: Labels | None = None) -> ForeignMatrices:
    """Matrices that are at hand, dense or sparse, with the checks of `read_matrices`.

    mass, stiffness, damping : (n, n) symmetric [kg], [N/m], [N s/m]; damping None or zero where there is none, and a
        stiffness of zero for what its contacts alone hold
    Raises  Refusal: not square, not symmetric, not finite, sizes that differ"""
    inputs = {"mass": mass, "stiffness": stiffness, "damping": damping}
    matrices = {part: matrix_files.real(value, f"{part} matrix") for part, value in inputs.items() if value is not None}
    return _checked(matrices, labels, floats=True)


def read_matrices(
    path: str | Path | None = None, *, mass: str | Path | None = None, stiffness: str | Path | None = None,
    damping: str | Path | None = None, mapping: str | Path | None = None, names: Mapping[str, str] | None = None,
    scale: float = 1.0,
) -> ForeignMatrices:  # fmt: skip
    """Read the matrices of a structure.

    path : one .npz, .mat, .op4 or DMIG file that holds all of them, by default as M, K and, if present, C (in files of
        Nastran also MAA, KAA, BAA or MAAX, KAAX, BAAX)
    mass, stiffness, damping : one file for each instead; formats as in matrix_files.read_matrix, mixed at will
    mapping : ANSYS .mapping file that labels the rows
    names : other variable names, such as {"mass": "Mred"}
    scale : factor on all matrices to reach SI; 1e3 for N-mm-t-s (rotations then count in units of 1000 rad)
    Raises  Refusal: not square, not symmetric, sizes that differ, a missing file or variable"""
    unknown = sorted(set(names or {}) - set(NAMES))
    if unknown:
        raise Refusal(f"names has the key {unknown[0]}: the keys are mass, stiffness and damping")
    files = {"mass": mass, "stiffness": stiffness, "damping": damping}
    present = [] if path is None else matrix_files.variables(Path(path))
    variable_names = {
        part: next((name for name in candidates if name in present), candidates[0])
        for part, candidates in NAMES.items()
    }
    variable_names |= names or {}
    if path is not None:
        file_of_all = Path(path)
        if not present:
            raise Refusal(
                f"{file_of_all.name} does not hold several matrices: give mass= and stiffness= as one file each"
            )
        for part, variable in variable_names.items():
            optional = part == "damping" and "damping" not in (names or {})
            if files[part] is None and (variable in present or not optional):
                files[part] = file_of_all
    missing = [part for part in ("mass", "stiffness") if files[part] is None]
    if missing:
        raise Refusal(f"no {missing[0]} matrix is given: give path= or {missing[0]}=")
    matrices: dict[str, sp.csr_matrix] = {}
    labels: dict[str, Labels | None] = {}
    for part, file in files.items():
        if file is not None:
            inside = matrix_files.variables(Path(file))
            variable_name = inside[0] if len(inside) == 1 and part not in (names or {}) else variable_names[part]
            matrix, labels[part] = matrix_files.read_matrix(Path(file), variable_name if inside else None)
            matrices[part] = matrix * scale
    rows = labels["stiffness"]
    for part, file_labels in labels.items():
        if rows is not None and file_labels is not None:
            matrices[part] = abaqus_matrix.onto(matrices[part], file_labels, rows, f"{part} matrix")
    if mapping is not None:
        rows = harwell_boeing.read_mapping(Path(mapping))
    return _checked(matrices, rows)


def _checked(matrices: dict[str, sp.csr_matrix], rows: Labels | None, floats: bool = False) -> ForeignMatrices:
    """The matrices of one structure, each symmetric and all of one size; a damping of zero is none.

    floats : whether a stiffness of zero is meant, as of a mass that only its contacts hold"""
    checked = {
        part: symmetric(matrix, f"{part} matrix", zero=floats and part == "stiffness")
        for part, matrix in matrices.items()
        if part != "damping" or abs(matrix).max() > 0 or matrix.shape[0] != matrix.shape[1]
    }
    n = checked["stiffness"].shape[0]
    for part, matrix in matrices.items():
        if matrix.shape[0] != n:
            raise Refusal(f"the {part} matrix has {matrix.shape[0]} rows but the stiffness matrix has {n}")
    if rows is not None and len(rows) != n:
        raise Refusal(f"the mapping has {len(rows)} equations but the matrices have {n} rows: is it theirs?")
    if (checked["mass"].diagonal() < 0).any():
        raise Refusal("the mass matrix has a negative diagonal entry: are mass and stiffness exchanged?")
    return _without_constrained(ForeignMatrices(**checked, labels=rows))


def reduced_model(system: SecondOrderSystem, interface: ContactInterface) -> ReducedModel:
    """The matrices as they are, dense, for hbm; meant for systems already reduced elsewhere (some thousand DOFs)."""
    damping = None if system.damping is None else dense(system.damping)
    small = replace(system, mass=dense(system.mass), stiffness=dense(system.stiffness), damping=damping)
    return ReducedModel(small, replace(interface, B=dense(interface.B)))


def _without_constrained(matrices: ForeignMatrices, penalty: float = 1e30) -> ForeignMatrices:
    """Leave out the DOFs that Abaqus holds by its penalty of 1e36 N/m, and note it."""
    constrained = matrices.stiffness.diagonal() >= penalty
    if not constrained.any():
        return matrices
    if matrices.labels is None:
        raise Refusal(
            f"{constrained.sum()} DOFs have a stiffness of {penalty:g} N/m or more, which is how Abaqus constrains: "
            "export with FORMAT=MATRIX INPUT, whose labels allow leaving them out"
        )
    free = np.flatnonzero(~constrained)
    return ForeignMatrices(
        mass=matrices.mass[free][:, free],
        stiffness=matrices.stiffness[free][:, free],
        damping=None if matrices.damping is None else matrices.damping[free][:, free],
        labels=tuple(matrices.labels[k] for k in free),
        notes=(
            *matrices.notes,
            f"{constrained.sum()} constrained DOFs (stiffness {penalty:g} N/m or more) were left out",
        ),
    )

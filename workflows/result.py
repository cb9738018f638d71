"""What a run leaves behind: everything that the summary and the pictures need, and nothing that needs a solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hbm.branch import Branch
from hbm.wear_history import WearHistory


@dataclass(frozen=True)
class PartMesh:
    """The mesh of the part as pictures need it.

    kind : VTK cell type name, such as "triquadratic_hexahedron"
    points : (n_node, 3) [m]
    cells : (n_cell, n_corner) node indices in VTK order
    """

    kind: str
    points: np.ndarray
    cells: np.ndarray


@dataclass(frozen=True)
class Patch:
    """The contact patch: a ContactInterface without its map to a model's coordinates.

    components : contact components in the order of the history's rows
    nodes : (n_pair,) node of the part at each pair, -1 where there is no mesh
    points, frames, area, gap, faces : as in fem.interface.ContactInterface
    free_deflection : (n_pair,) normal approach under the static loads with body 2 absent [m]
    """

    components: tuple[str, ...]
    nodes: np.ndarray
    points: np.ndarray
    frames: np.ndarray
    area: np.ndarray
    gap: np.ndarray
    faces: np.ndarray
    free_deflection: np.ndarray


@dataclass(frozen=True)
class References:
    """Linear amplitudes of the observed output around the nonlinear one.

    omega : (n_reference,) [rad/s]
    free : (n_reference,) amplitude with the contact absent [m]
    stuck : (n_reference,) amplitude with every contact closed and sticking [m]
    """

    omega: np.ndarray
    free: np.ndarray
    stuck: np.ndarray


@dataclass(frozen=True)
class Fields:
    """Full displacement of the part at chosen wear steps.

    row : (n_field,) rows of the wear history
    displacement : (n_field, n_node, 3, n_coeff) Fourier coefficients [m]
    """

    row: np.ndarray
    displacement: np.ndarray


@dataclass(frozen=True)
class Loops:
    """Periodic contact displacement and force over one cycle, at the same wear steps as the fields.

    row : (n_field,) rows of the wear history
    displacement, force : (n_field, n_pair, n_component, n_sample) [m], [N]
    """

    row: np.ndarray
    displacement: np.ndarray
    force: np.ndarray


@dataclass(frozen=True)
class Result:
    """A run, finished or not.

    provenance : scene text and overrides, versions, seed, start time, threads
    facts : what was modelled and how long it took: sizes, solver names, delta_max_m, seconds, ...
    state : sentence that says how far the run came
    frf : response curve of the unworn contact
    """

    provenance: Mapping[str, str]
    facts: Mapping[str, str | int | float]
    state: str
    patch: Patch | None = None
    part: PartMesh | None = None
    references: References | None = None
    frf: Branch | None = None
    wear: WearHistory | None = None
    fields: Fields | None = None
    loops: Loops | None = None

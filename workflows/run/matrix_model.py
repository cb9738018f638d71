"""From a scene with matrices to its reduced model."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.foreign import ForeignMatrices, read_matrices, reduced_model
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.matrix_files import read_array
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.matrix_scene import DofOutput, MatrixFiles, MatrixScene, Variable

OUTPUT = "response"

Take = Callable[[Variable], np.ndarray]


def read(files: MatrixFiles, folder: Path) -> ForeignMatrices:
    """The matrices of a scene; names of files begin in `folder`. raises Refusal for files that cannot be used."""
    named = {key: folder / name for key, name in files if isinstance(name, str) and key != "file"}
    path = None if files.file is None else folder / files.file
    return read_matrices(path, **named, names=files.names, scale=files.scale)


def lines(matrices: ForeignMatrices) -> list[str]:
    """Sentences on matrices: what was changed on reading, their rigid-body modes, mass and first modes, doubts."""
    try:
        return [*matrices.notes, *matrices.facts().lines()]
    except Refusal as problem:
        return [*matrices.notes, f"matrices: their modes are not known, {problem}"]


def make(scene: MatrixScene, folder: Path) -> ReducedModel:
    """The model of a scene, with the damping of its files.

    Raises  Refusal: files, variables or DOFs that cannot be used"""
    matrices, contact, response = read(scene.model, folder), scene.contact, scene.response

    def take(variable: Variable) -> np.ndarray:
        if scene.model.file is None:
            raise Refusal(f'variable = "{variable.variable}" needs model.file, the file that holds it')
        return read_array(folder / scene.model.file, variable.variable)

    system = matrices.system(
        _vectors({**scene.loads.static, **scene.loads.harmonic}, take),
        _vectors({OUTPUT: response, **response.others}, take),
    )
    interface = matrices.contact(
        _table(contact.dofs, take),
        None if contact.opposite is None else _table(contact.opposite, take),
        area=_per_pair(contact.area, take),
        components=contact.components,
        normal=contact.normal,
        t1=contact.t1,
        signs=contact.signs,
        gap=_per_pair(contact.gap, take),
        points=None if contact.points is None else take(contact.points),
    )
    if scene.reduction is not None:
        return craig_bampton(system, interface, scene.reduction.modes, scene.reduction.cutoff)
    model = reduced_model(system, interface)
    free = linear_modes(model, n=min(10, model.system.n_dof))[0]
    return replace(model, free_frequency=free)


def _table(rows: Any, take: Take) -> Any:
    """Rows of DOFs, those of the file as whole numbers."""
    if not isinstance(rows, Variable):
        return rows
    table = np.atleast_2d(take(rows))
    if (table != np.round(table)).any():
        raise Refusal(f'variable = "{rows.variable}" holds numbers that are not whole: DOFs count from 0')
    return table.astype(int)


def _per_pair(value: float | tuple[float, ...] | Variable, take: Take) -> float | np.ndarray:
    if isinstance(value, Variable):
        return take(value).ravel()
    return value if isinstance(value, float) else np.array(value)


def _vectors(entries: Mapping[str, DofOutput], take: Take) -> dict[str, Any]:
    """name -> DOF factors: equal shares of the DOFs, or the vector of the file."""
    vectors: dict[str, Any] = {}
    for name, entry in entries.items():
        dofs = entry.dofs or ()
        vectors[name] = {dof: 1 / len(dofs) for dof in dofs} if entry.vector is None else take(entry.vector).ravel()
    return vectors

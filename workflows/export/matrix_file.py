"""The reduced model of a result for other solvers: npz, Matrix Market and Abaqus matrix input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.io import mmwrite

from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress


def reduced_model(result: Result) -> ReducedModel:
    """The reduced model that a result was computed with, made again from its scene.

    Raises  ValueError where its parts are not there any more
    """
    from tribodyn.workflows.result.provenance import rebuilt

    return modelling.build(rebuilt(result), None, Progress(), result.harmonics).reduced


def arrays(model: ReducedModel, harmonic: int = 1) -> dict[str, np.ndarray]:
    """M, K, C (n, n), B (n_contact, n), loads and outputs by name as a harmonic sees them; complex for a wheel."""
    model.require_masters("an export of matrices")
    system, B = model.at_harmonic(harmonic)
    found = {"M": _dense(system.mass), "K": _dense(system.stiffness), "B": _dense(B)}
    if system.damping is not None:
        found["C"] = _dense(system.damping)
    found |= {f"load_{name}": _dense(vector) for name, vector in system.loads.items()}
    found |= {f"output_{name}": _dense(vector) for name, vector in system.outputs.items()}
    i = model.interface
    return found | {
        "contact_area": i.area,
        "contact_gap": i.gap,
        "contact_points": i.points,
        "contact_frames": i.frames,
    }


def _dense(matrix: Any) -> np.ndarray:
    return np.asarray(matrix.toarray() if sp.issparse(matrix) else matrix)


def write_npz(result: Result, folder: Path) -> list[Path]:
    """reduced.npz, that a scene's [model] reads again."""
    model, path = reduced_model(result), folder / "reduced.npz"
    found = arrays(model)
    if 0 in result.harmonics and model.per_harmonic is not None:
        static = arrays(model, 0)
        found |= {f"{name}_harmonic_0": static[name] for name in ("M", "K", "C", "B") if name in static}
    np.savez_compressed(path, components=np.array(model.interface.components), **found)  # type: ignore[arg-type]
    return [path]


def write_mtx(result: Result, folder: Path) -> list[Path]:
    """reduced_M.mtx and so on in the Matrix Market format, and reduced.json that describes them."""
    model = reduced_model(result)
    written = []
    for name, matrix in arrays(model).items():
        path = folder / f"reduced_{name}.mtx"
        symmetric = name in ("M", "K", "C")
        kind = "general" if not symmetric else "hermitian" if np.iscomplexobj(matrix) else "symmetric"
        if symmetric:
            matrix = sp.coo_matrix((matrix + matrix.conj().T) / 2)
        elif matrix.ndim != 2:
            matrix = matrix.reshape(len(matrix), -1)
        mmwrite(path, matrix, symmetry=kind, precision=17)
        written.append(path)
    about_file = folder / "reduced.json"
    about = {
        "components": model.interface.components,
        "units": "SI",
        "contact": "x = B q, row pair * n_component + component",
    }
    about_file.write_text(json.dumps(about, indent=2), encoding="utf-8")
    return [*written, about_file]


def write_abaqus(result: Result, folder: Path) -> list[Path]:
    """reduced_M.inp, reduced_K.inp, reduced_C.inp as *MATRIX INPUT reads them, and reduced.inp that assembles them.

    Coordinate i of the model is degree of freedom 1 of node i + 1; the lower triangle of a symmetric matrix is written.
    Raises  ValueError for the complex matrices of a wheel
    """
    model, written, called = reduced_model(result), [], []
    found = arrays(model)
    if np.iscomplexobj(found["K"]):
        raise ValueError("abaqus: the matrices of a wheel are complex, which Abaqus does not take; export npz or mtx")
    words = {"K": "STIFFNESS", "M": "MASS", "C": "VISCOUS DAMPING"}
    for name in words:
        if name not in found:
            continue
        path = folder / f"reduced_{name}.inp"
        lower = np.tril((found[name] + found[name].T) / 2)
        rows, columns = np.nonzero(lower)
        with path.open("w", encoding="ascii") as file:
            for i, j in zip(rows, columns, strict=True):
                file.write(f"{i + 1},1,{j + 1},1,{lower[i, j]:.16e}\n")
        written.append(path)
        called.append(name)
    top = folder / "reduced.inp"
    lines = ["*HEADING", f"reduced model of {result.provenance['scene_name']}, SI units", "*NODE, NSET=COORDINATES"]
    lines += [f"{i + 1}, {float(i)}, 0., 0." for i in range(len(found["K"]))]
    for name in called:
        lines.append(f"*MATRIX INPUT, NAME={name}, INPUT=reduced_{name}.inp, TYPE=SYMMETRIC")
    lines.append("*MATRIX ASSEMBLE, " + ", ".join(f"{words[name]}={name}" for name in called))
    top.write_text("\n".join([*lines, ""]), encoding="ascii")
    return [*written, top]

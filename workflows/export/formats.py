"""The formats that `tribodyn export` knows, by name; the reduced model for other solvers is written here."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.io import savemat

from tribodyn.fem.system import dense
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal
from tribodyn.workflows.export import result_tables, vtk
from tribodyn.workflows.result.provenance import rebuilt
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress


def reduced_model(result: Result) -> ReducedModel:
    """The reduced model that a result was computed with, made again from its scene.

    Raises  ValueError where its parts are not there any more"""
    return modelling.build(rebuilt(result), Progress(), result.harmonics).reduced


def arrays(model: ReducedModel, harmonic: int = 1) -> dict[str, np.ndarray]:
    """M, K, C (n, n), B (n_contact, n), loads and outputs by name as a harmonic sees them; complex for a wheel."""
    model.require_masters("an export of matrices")
    system, B = model.at_harmonic(harmonic)
    matrices = {"M": dense(system.mass), "K": dense(system.stiffness), "B": dense(B)}
    if system.damping is not None:
        matrices["C"] = dense(system.damping)
    matrices |= {f"load_{name}": dense(vector) for name, vector in system.loads.items()}
    matrices |= {f"output_{name}": dense(vector) for name, vector in system.outputs.items()}
    i = model.interface
    return matrices | {
        "contact_area": i.area,
        "contact_gap": i.gap,
        "contact_points": i.points,
        "contact_frames": i.frames,
    }


def write_npz(result: Result, folder: Path) -> list[Path]:
    """reduced.npz, that a scene's [model] reads again."""
    model, path = reduced_model(result), folder / "reduced.npz"
    matrices = arrays(model)
    if 0 in result.harmonics and not model.has_one_system:
        static = arrays(model, 0)
        matrices |= {f"{name}_harmonic_0": static[name] for name in ("M", "K", "C", "B") if name in static}
    np.savez_compressed(path, components=np.array(model.interface.components), **matrices)  # type: ignore[arg-type]
    return [path]


def write_matlab(result: Result, folder: Path) -> list[Path]:
    """reduced.mat with the same variables as reduced.npz, which a scene's [model] reads again."""
    model, path = reduced_model(result), folder / "reduced.mat"
    matrices = arrays(model) | {"components": np.array(model.interface.components, dtype=object)}
    for name in {"M", "K", "C"} & matrices.keys():  # without the rounding of the reduction, to come back bit for bit
        matrices[name] = (matrices[name] + matrices[name].conj().T) / 2
    savemat(path, matrices, long_field_names=True, do_compression=True)
    return [path]


FORMATS: dict[str, tuple[str, Callable[..., list[Path]]]] = {
    "vtk": ("series for ParaView over wear and over a cycle (.pvd, .vtu, .vtp)", vtk.write_vtk),
    "csv": ("every curve and history as a table", result_tables.write_csv),
    "mat": ("the same tables as structs for MATLAB", result_tables.write_mat),
    "uff": ("universal file, dataset 58, for tools of measured data", result_tables.write_uff),
    "mesh": ("worn part with its fields (.xdmf; another format with --mesh-ending)", vtk.write_mesh),
    "npz": ("reduced matrices for NumPy, and for a scene's [model]", write_npz),
    "matlab": ("reduced matrices for MATLAB, and for a scene's [model]", write_matlab),
}


def write(result: Result, names: Sequence[str], folder: Path, mesh_ending: str = ".xdmf") -> list[Path]:
    """Write a result in some formats, each into a folder of its name; returns the files to open.

    Raises  ValueError: a format that is not known, or that cannot hold this result"""
    for name in names:
        if name not in FORMATS:
            raise Refusal(f"--to {name}: no such format; there are {', '.join(FORMATS)}")
    written = []
    for name in dict.fromkeys(names):
        place = folder / name
        place.mkdir(parents=True, exist_ok=True)
        written += FORMATS[name][1](result, place, **({"ending": mesh_ending} if name == "mesh" else {}))
    return written

"""A reduced model as an HDF5 file, so that a response needs no mesh.

Layout: /system (mass, stiffness, damping, loads/<name>, outputs/<name>), /interface (points, frames, area, gap, B,
faces), /basis, /info; attributes format, version at the root, components on /interface. A model whose harmonics see
different systems has besides /systems/<i>, like /system with B and basis, each system once, and /harmonics
(n_harmonic, 2), which of them every stored harmonic sees.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ModelInfo, ReducedModel

FORMAT = "tribodyn reduced model"
VERSION = 2
INFO = tuple(item.name for item in fields(ModelInfo) if item.name not in ("joints", "reaction"))  # what is data


def save(model: ReducedModel, path: str | Path, harmonics: Sequence[int] = ()) -> None:
    """Write a model; the file appears complete or not at all. Joints and reaction of its info stay behind.

    harmonics : those to store of a model whose harmonics see different systems, such as a travelling wave
    Raises  ValueError for such a model without harmonics
    """
    if model.per_harmonic is not None and not harmonics:
        raise ValueError("this model differs from harmonic to harmonic: give the harmonics to store")
    path = Path(path)
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        with h5py.File(partial, "w") as file:
            _write_model(file, model, harmonics)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def _write_model(file: h5py.File, model: ReducedModel, harmonics: Sequence[int]) -> None:
    file.attrs["format"] = FORMAT
    file.attrs["version"] = VERSION
    interface = model.interface
    _write_system(file.create_group("system"), model.system)
    if model.per_harmonic is not None:
        _write_harmonics(file, model, harmonics)
    fields = {name: getattr(interface, name) for name in ("points", "frames", "area", "gap", "B", "faces")}
    _write(file.create_group("interface"), fields)
    file["interface"].attrs["components"] = list(interface.components)
    _write(file, {"basis": model.basis})
    _write(file.create_group("info"), {name: getattr(model.info, name) for name in INFO})


def load(path: str | Path) -> ReducedModel:
    """Read a model that `save` wrote.

    Raises  ValueError for a file that is missing, no HDF5, no reduced model, or of another version
    """
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise ValueError(f"'{path}' cannot be read as a reduced model: {_reason(error)}") from error
    with file:
        if file.attrs.get("format") != FORMAT:
            raise ValueError(f"'{path}' is an HDF5 file but no reduced model; give one that tribodyn's reduction wrote")
        if file.attrs["version"] != VERSION:
            raise ValueError(
                f"'{path}' is a reduced model of version {file.attrs['version']}, but this program reads version "
                f"{VERSION}; run the reduction again"
            )
        interface = _read(file["interface"])
        model = ReducedModel(
            _read_system(file["system"]),
            ContactInterface(components=tuple(file["interface"].attrs["components"]), **interface),
            file["basis"][()] if "basis" in file else None,
            _info(_read(file["info"])),
        )
        return _with_harmonics(file, model) if "harmonics" in file else model


def _info(stored: Mapping[str, Any]) -> ModelInfo:
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in stored.items()}
    return ModelInfo(**{name: value for name, value in plain.items() if name in INFO})


def _write_harmonics(file: h5py.File, model: ReducedModel, harmonics: Sequence[int]) -> None:
    """Each system that one of the harmonics sees, once, and which of them each sees."""
    seen: dict[int, tuple[int, SecondOrderSystem]] = {}  # the key lives as long as its system
    table = []
    for h in sorted(set(harmonics)):
        system, B = model.at_harmonic(h)
        if id(system) not in seen:
            seen[id(system)] = len(seen), system
            group = file.create_group(f"systems/{seen[id(system)][0]}")
            _write_system(group, system)
            _write(group, {"B": B, "basis": model.harmonic_basis(h) if model.harmonic_basis else None})
        table.append((h, seen[id(system)][0]))
    file.create_dataset("harmonics", data=np.array(table))


def _with_harmonics(file: h5py.File, model: ReducedModel) -> ReducedModel:
    """The model with the systems of its stored harmonics; any other harmonic is a ValueError."""
    systems, maps, bases = {}, {}, {}
    for name, group in file["systems"].items():
        i = int(name)
        systems[i], maps[i] = _read_system(group), group["B"][()]
        bases[i] = group["basis"][()] if "basis" in group else None
    place = {int(h): int(i) for h, i in file["harmonics"][()]}

    def known(h: int) -> int:
        if h not in place:
            held = ", ".join(map(str, place))
            raise ValueError(f"harmonic {h} of this model is not in its file, which holds {held}: store it too")
        return place[h]

    def per_harmonic(h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        return systems[known(h)], maps[known(h)]

    def harmonic_basis(h: int) -> np.ndarray:
        basis = bases[known(h)]
        assert basis is not None
        return basis

    own = all(basis is not None for basis in bases.values())
    return replace(model, per_harmonic=per_harmonic, harmonic_basis=harmonic_basis if own else None)


def _write_system(group: h5py.Group, system: SecondOrderSystem) -> None:
    _write(group, {"mass": system.mass, "stiffness": system.stiffness, "damping": system.damping})
    _write(group, {"gyroscopic": system.gyroscopic})
    _write(group.create_group("loads"), system.loads)
    _write(group.create_group("outputs"), system.outputs)


def _read_system(group: h5py.Group) -> SecondOrderSystem:
    matrices = _read(group)
    loads, outputs = _read(group["loads"]), _read(group["outputs"])
    damping, gyroscopic = matrices.get("damping"), matrices.get("gyroscopic")
    return SecondOrderSystem(matrices["mass"], matrices["stiffness"], damping, loads, outputs, gyroscopic)


def _write(group: h5py.Group, values: Mapping[str, object]) -> None:
    """Datasets of a group in their own order; None is left out."""
    for place, (name, value) in enumerate(values.items()):
        if value is not None:
            group.create_dataset(name, data=value).attrs["place"] = place


def _read(group: h5py.Group) -> dict:
    """Datasets of a group as arrays, numbers and strings, in the order they were written."""
    found = [(item.attrs["place"], name, item) for name, item in group.items() if isinstance(item, h5py.Dataset)]
    return {
        name: item.asstr()[()] if h5py.check_string_dtype(item.dtype) else item[()] for _, name, item in sorted(found)
    }


def _reason(error: OSError) -> str:
    return "there is no such file" if isinstance(error, FileNotFoundError) else "it is not an HDF5 file"

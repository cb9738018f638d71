"""A reduced model as an HDF5 file, so that a response needs no mesh.

Layout: /system (mass, stiffness, damping, loads/<name>, outputs/<name>), /interface (points, frames, area, gap, B,
faces), /basis, /info; attributes format, version at the root, components on /interface.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import h5py

from fem.interface import ContactInterface
from fem.system import SecondOrderSystem
from reduction.model import ReducedModel

FORMAT = "tribodyn reduced model"
VERSION = 1


def save(model: ReducedModel, path: str | Path) -> None:
    """Write a model; the file appears complete or not at all.

    Raises  ValueError for a model whose harmonics see different systems: those are a function, not data
    """
    if model.per_harmonic is not None:
        raise ValueError("this model differs from harmonic to harmonic and cannot be stored; store what it is made of")
    path = Path(path)
    partial = path.with_name(path.name + ".partial")
    with h5py.File(partial, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["version"] = VERSION
        system, interface = model.system, model.interface
        _write(
            file.create_group("system"),
            {"mass": system.mass, "stiffness": system.stiffness, "damping": system.damping},
        )
        _write(file.create_group("system/loads"), system.loads)
        _write(file.create_group("system/outputs"), system.outputs)
        fields = {name: getattr(interface, name) for name in ("points", "frames", "area", "gap", "B", "faces")}
        _write(file.create_group("interface"), fields)
        file["interface"].attrs["components"] = list(interface.components)
        _write(file, {"basis": model.basis})
        _write(file.create_group("info"), model.info)
    os.replace(partial, path)


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
        system = _read(file["system"])
        interface = _read(file["interface"])
        return ReducedModel(
            SecondOrderSystem(
                system["mass"],
                system["stiffness"],
                system.get("damping"),
                _read(file["system/loads"]),
                _read(file["system/outputs"]),
            ),
            ContactInterface(components=tuple(file["interface"].attrs["components"]), **interface),
            file["basis"][()] if "basis" in file else None,
            _read(file["info"]),
        )


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

"""The result file: HDF5 with dimension scales, replaced as a whole at every checkpoint.

Whoever opens the file, at any moment and after any kill, finds one complete checkpoint. The HDF5 content follows a user
block of USER_BLOCK bytes, which every HDF5 reader skips; it holds a checksum of the content. The content is made in
memory and written by plain file operations, since HDF5 itself does not survive a full disk."""

import hashlib
import io
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from pydantic import TypeAdapter

from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.outcome import BranchEnd, End, Outcome, SolveEnd, WearEnd
from tribodyn.hbm.stability.branch_stability import BranchStability
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.hdf5_file import opened_hdf5
from tribodyn.output_file import printable, replacing
from tribodyn.refusal import Refusal
from tribodyn.workflows.result.model_facts import ModelFacts, Stage
from tribodyn.workflows.result.result import (
    Fields,
    Loops,
    PartMesh,
    Patch,
    References,
    Result,
    Stress,
)
from tribodyn.workflows.result.verdict import Verdict
from tribodyn.workflows.scene import scene_file

FORMAT = "tribodyn result 5"
USER_BLOCK = 512  # bytes before the HDF5 content, the least that HDF5 allows
MARK = b"tribodyn result, sha256 of what follows this block: "
FIELD = {"frf": "response"}  # groups of the file that have another name than the field of a Result

Ended = TypeVar("Ended", bound=End)
KIND = "end_kind"  # attribute with the name of the member whose sentence stands in "end"
ENDS: dict[type, type[End]] = {Branch: BranchEnd, WearHistory: WearEnd}
MEMORY = "memory"  # group with the arrays that a wear rule remembers from step to step
KINDS = "outcome_kind"  # attribute with the names of the members whose sentences stand in "outcome"

Arrays = Mapping[str, tuple[tuple[str, ...], str]]
"""array -> dimensions and unit; the unit of whole numbers that count the entries of a dimension is # with its name"""
INDEX = "#"


def _arrays(of: Mapping[str, str]) -> Arrays:
    """Arrays of a group from dimensions -> "array array:unit", both as words."""
    entries = ((dimensions, word.partition(":")) for dimensions, words in of.items() for word in words.split())
    return {name: (tuple(dimensions.split()), unit) for dimensions, (name, _, unit) in entries}


# group -> (type, its arrays); what is not an array is an attribute of the group
SCHEMA: dict[str, tuple[type, Arrays]] = {
    name: (kind, _arrays(of))
    for name, kind, of in (
        ("patch", Patch, {
            "pair": "nodes:#node area:m2 gap:m free_deflection:m", "pair xyz": "points:m", "pair axis xyz": "frames",
            "face face_corner": "faces:#pair",
        }),
        ("part", PartMesh, {"node xyz": "points:m", "cell cell_corner": "cells:#node"}),
        ("references", References, {"reference": "omega:rad/s free:m stuck:m"}),
        ("frf", Branch, {
            "point": "omega:rad/s energy:J newton_steps parameter", "fold": "folds:#point",
            "harmonic": "harmonics",
            "point output coefficient": "response:m", "point contact coefficient": "contact:m",
        }),
        ("stability", BranchStability, {"point": "stable growth:1/s", "bifurcation": "omega:rad/s position"}),
        ("wear", WearHistory, {
            "row": "cycles cycles_in_step preload:N omega:rad/s amplitude:m solves step_error preload_at_rest:N growth "
                   "spread mean_error is_stationary periods",
            "row pair": "depth:m worn:m energy:J normal_force:N status work:J bed:m",
            "row contact coefficient": "force:N", "row output coefficient": "response:m", "row moving": "moving",
            "row duty": "duty_omega:rad/s", "row duty contact coefficient": "duty_displacement:m",
            "row duty output coefficient": "duty_response:m",
        }),
        ("fields", Fields, {"field": "row:#row", "field node xyz coefficient": "displacement:m"}),
        ("stress_field", Stress, {
            "field": "row:#row", "field spot": "spot:#node spot_kind", "field spot xyz": "spot_point:m",
            "field node": "largest:Pa utilisation mean:Pa amplitude:Pa", "field node moment voigt": "tensor:Pa",
            "field pair": "tension:Pa watson:Pa face_node:#node",
        }),
        ("loops", Loops, {"field": "row:#row", "field pair component sample": "displacement:m force:N"}),
    )
}  # fmt: skip


class ResultError(Refusal):
    """A result file cannot be used; the message is one sentence."""


def save(path: Path, result: Result) -> None:
    """Write a result so that `path` holds either the old or the new one, never a part of it."""
    with h5py.File(path.name, "w", driver="core", backing_store=False, libver="v110") as file:
        _write(file, result)
        file.flush()
        content = file.id.get_file_image()
    head = MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"
    try:
        with replacing(path) as temporary:
            temporary.write_bytes(head.ljust(USER_BLOCK, b"\0") + content)
    except OSError as error:
        raise ResultError(f'the result cannot be written to "{path}": {error.strerror or error}') from error


def _write(file: h5py.File, result: Result) -> None:
    file.attrs["format"] = FORMAT
    file.attrs["state"] = result.state
    file.attrs["stage"] = result.stage.name
    file.attrs["verdict"] = "" if result.verdict is None else json.dumps(asdict(result.verdict))
    facts, scales = result.facts.table(), dict[str, h5py.Dataset]()
    provenance = {**result.provenance, "scene": result.scene.model_dump_json()}
    for name, table in (("provenance", provenance), ("facts", facts)):
        group = file.create_group(name)
        for key, value in table.items():
            group.attrs[key] = value
    for name, (_, arrays) in SCHEMA.items():
        part = getattr(result, FIELD.get(name, name))
        if part is None:
            continue
        group = file.create_group(name)
        for item in fields(part):
            value = getattr(part, item.name)
            if value is None:  # an array that this run did not ask for
                continue
            if item.name in arrays:
                # numpy takes an empty tuple for one of floats
                dtype = np.int64 if isinstance(value, tuple) and not value else None
                _write_array(file, scales, group, item.name, np.asarray(value, dtype), *arrays[item.name])
            elif isinstance(value, Outcome):
                group.attrs[item.name], group.attrs[KIND] = str(value), value.kind.name
            elif isinstance(value, Mapping):  # arrays of a wear rule, which alone knows their names
                for name, array in value.items():
                    axes = (f"{name}_{i}" for i in range(1, array.ndim))
                    _write_array(file, scales, group.require_group(item.name), name, array, ("row", *axes), "")
            elif item.name == "outcome":
                group.attrs[item.name] = _strings(str(outcome) for outcome in value)
                group.attrs[KINDS] = _strings(outcome.kind.name for outcome in value)
            else:
                group.attrs[item.name] = value if isinstance(value, str) else _strings(value)


def _strings(values: Iterable[str]) -> np.ndarray:
    return np.array(list(values), dtype=h5py.string_dtype())


def _write_array(
    file: h5py.File,
    scales: dict[str, h5py.Dataset],
    group: h5py.Group,
    name: str,
    value: np.ndarray,
    dimensions: tuple[str, ...],
    unit: str,
) -> None:
    """An array with its unit and dimensions; scales : of those that other arrays of the file have had, by name."""
    data = group.create_dataset(name, data=value)
    if unit and not unit.startswith(INDEX):
        data.attrs["units"] = unit
    for axis, (dimension, size) in enumerate(zip(dimensions, value.shape, strict=True)):
        if dimension not in scales:
            scales[dimension] = file.create_dataset(dimension, data=np.arange(size))
            scales[dimension].make_scale(dimension)
        if scales[dimension].shape != (size,):
            raise Refusal(f"dimension {dimension} has {len(scales[dimension])} entries, an array has {size}")
        data.dims[axis].attach_scale(scales[dimension])


ResultSource = Result | str | os.PathLike[str]
"""A result, or where one is: its folder, or the file result.h5 itself."""


def result_of(result: ResultSource) -> Result:
    """A result that is given, or read from where it is; raises ResultError."""
    return result if isinstance(result, Result) else load(result)


def result_file(path: str | os.PathLike[str]) -> Path:
    """File of a result that is given by its folder or by itself."""
    path = Path(path)
    return path / "result.h5" if path.is_dir() else path


def load(path: str | os.PathLike[str]) -> Result:
    """Read a result: its folder, or the file result.h5 itself.

    Raises  ResultError where there is none, or where it has changed since it was written"""
    path = result_file(path)
    if not path.is_file():  # a pipe would be waited for
        raise ResultError(f'there is no result file "{path}"')
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ResultError(f'the result file "{path}" cannot be read: {error.strerror or error}') from None
    if data.startswith(MARK[:8]):
        content = data[USER_BLOCK:]
        if not data.startswith(MARK + hashlib.sha256(content).hexdigest().encode()):
            raise ResultError(f'"{path}" is damaged, its checksum differs: run its scene again')
        data = content
    try:
        with opened_hdf5(io.BytesIO(data)) as file:
            if str(file.attrs.get("format")) != FORMAT:
                raise ResultError(f'"{path}" is not a result file of this version of tribodyn')
            return _result(file)
    except ResultError:
        raise
    except Refusal as error:
        raise ResultError(f'"{path}": {error}') from None
    except OSError:
        raise ResultError(f'"{path}" is not a result file of tribodyn') from None
    except (KeyError, TypeError, ValueError, RecursionError):
        raise ResultError(f'"{path}" was written by another version of tribodyn: run its scene again') from None


def _result(file: h5py.File) -> Result:
    """The result in a file; raises KeyError, TypeError or ValueError where its structure is not that of `SCHEMA`."""
    sizes: dict[str, int] = {}
    parts = {
        FIELD.get(name, name): _read(file[name], kind, arrays, sizes)
        for name, (kind, arrays) in SCHEMA.items()
        if name in file
    }
    provenance = {key: _text(value) for key, value in file["provenance"].attrs.items()}
    scene = scene_file.from_json(provenance.pop("scene"))
    facts = {key: v.item() if isinstance(v, np.generic) else v for key, v in file["facts"].attrs.items()}
    joints = {name: slice(*ends) for name, ends in json.loads(facts.get("joints", "{}")).items()}
    verdict = _text(file.attrs["verdict"])
    result = Result(
        provenance=provenance,
        scene=scene,
        facts=ModelFacts.of(facts | {"joints": joints}),
        stage=Stage[_text(file.attrs["stage"])],
        verdict=TypeAdapter(Verdict).validate_json(verdict) if verdict else None,
        **parts,
    )
    _require_consistent(result, sizes)
    return result


def _require_consistent(result: Result, sizes: Mapping[str, int]) -> None:
    """Raise ValueError where arrays contradict each other; sizes : of the dimensions of all arrays, by name."""
    sizes = {"row": sizes.get("point", 0), **sizes}
    for name, (_, arrays) in SCHEMA.items():
        part = getattr(result, FIELD.get(name, name))
        if name in ("frf", "stability") and part is not None and not np.isfinite(part.omega).all():
            raise ValueError(f"{name}/omega is not finite")
        for array, (_, unit) in arrays.items() if part is not None else ():
            numbers = np.asarray(getattr(part, array))
            size = sizes.get(unit.removeprefix(INDEX)) if unit.startswith(INDEX) else None
            if size is None or not numbers.size:  # without renders a result holds no nodes that pairs could count
                continue
            if numbers.dtype.kind not in "iu" or numbers.min() < -1 or numbers.max() >= size:
                raise ValueError(f"{name}/{array} counts beyond its {size} entries")
    pairs, components, response = sizes["pair"], result.patch.components, result.response
    expected = {"contact": pairs * len(components), "coefficient": 2 * len(result.harmonics) - (0 in result.harmonics)}
    if response is not None:
        expected |= {"output": len(response.output_names), "point": len(response.outcome)}
    if any(sizes.get(name, size) != size for name, size in expected.items()):
        raise ValueError(f"dimensions are not {expected}")
    if any(not 0 <= of.start <= of.stop <= pairs for of in result.facts.joints.values()):
        raise ValueError("a contact has pairs beyond the last")


def file_digests(result: Result) -> dict[str, str]:
    """File beside the scene -> digest of its content when the result was computed."""
    return dict(json.loads(result.provenance.get("files", "{}")))


def _read(group: h5py.Group, kind: type, arrays: Arrays, sizes: dict[str, int]) -> Any:
    """One part of a result; sizes : of the dimensions so far, by name, which an array must agree with."""
    values: dict[str, Any] = {}
    for item in fields(kind):
        if item.name in arrays:
            if item.name not in group and item.default is None:
                continue
            value = _numbers(group[item.name])
            for name, size in zip(arrays[item.name][0], value.shape, strict=True):
                if sizes.setdefault(name, size) != size:
                    raise ValueError(f"{item.name} has {size} of {name}, other arrays {sizes[name]}")
            values[item.name] = tuple(value.tolist()) if str(item.type).startswith("tuple") else value
        elif item.name == MEMORY:
            values[item.name] = {name: _numbers(array) for name, array in group.get(item.name, {}).items()}
        elif item.name == "end":
            values[item.name] = _outcome(ENDS[kind], _text(group.attrs[KIND]), _text(group.attrs[item.name]))
        elif item.name == "outcome":
            ends = zip(group.attrs[KINDS], group.attrs[item.name], strict=True)
            values[item.name] = tuple(_outcome(SolveEnd, _text(name), _text(text)) for name, text in ends)
        else:
            value = group.attrs[item.name]
            is_text = item.type in (str, "str")
            values[item.name] = _text(value) if is_text else tuple(_text(entry) for entry in value)
    return kind(**values)


def _numbers(dataset: Any) -> np.ndarray:
    """An array; raises ValueError for what is none or has no real numbers, or more than the file has bytes."""
    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "biuf":
        raise ValueError(f"{dataset.name} holds no real numbers")
    if dataset.id.get_storage_size() < dataset.nbytes:  # nothing is compressed; what is not stored has any size
        raise ValueError(f"{dataset.name} is not stored in full")
    return np.asarray(dataset[()])


def _text(value: Any) -> str:
    """A text without what a terminal would obey; raises TypeError for what is none."""
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return printable(value)


def _outcome(ends: type[Ended], name: str, sentence: str) -> Outcome[Ended]:
    end = ends[name]
    return end.say(sentence.removeprefix(end.value))

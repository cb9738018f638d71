"""Reading a scene by name, path, tables or as read before: find it, apply overrides, check it, and report what is wrong
in one sentence."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import tomli_w
from pydantic import BaseModel, ValidationError

from tribodyn.refusal import Refusal
from tribodyn.text_file import text_of
from tribodyn.workflows.scene.fields import UnknownKey, unknown_key
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.schema import MeshScene, Scene

CASES = Path(__file__).parents[1] / "cases"
MOST_PROBLEMS = 3  # reported in one sentence

Kind = TypeVar("Kind", bound=BaseModel)


class SceneError(Refusal):
    """A scene asks for something that cannot be; the message is one sentence with the key and the cure."""


@dataclass(frozen=True)
class SceneFile:
    """A scene with where it came from.

    name : file name without its ending
    text : the TOML text as it stands in the file
    overrides : "section.key=value" texts in the order they were applied
    folder : where relative file names of the scene begin"""

    name: str
    text: str
    overrides: tuple[str, ...]
    folder: Path
    scene: Scene

    @property
    def word(self) -> str:
        """By what a command knows it: the name of a scene that comes with the program, the path of another one."""
        return self.name if self.is_shipped else str(self.folder / f"{self.name}.toml")

    @property
    def is_shipped(self) -> bool:
        """Whether it is a scene that comes with the program."""
        return self.folder.resolve().parent == CASES.resolve()

    def changed(self, *overrides: str) -> SceneFile:
        """The same with further overrides; raises SceneError."""
        return parse(self.text, f"{self.name}.toml", (*self.overrides, *overrides), self.folder)

    @property
    def mesh_scene(self) -> MeshScene:
        """The scene, for what needs a mesh; raises SceneError where it is one of matrices."""
        if not isinstance(self.scene, MeshScene):
            raise SceneError(f"{self.name} is made of matrices and has no mesh")
        return self.scene


def _shipped() -> dict[str, Path]:
    """Files of the scenes that come with the program, by their names; studies and fits have two endings."""
    return {path.stem: path for path in CASES.glob("*/*.toml") if "." not in path.stem}


def names() -> list[str]:
    """Scenes that come with the program."""
    return sorted(_shipped())


def title(name: str) -> str:
    """Title of a scene that comes with the program, without checking the rest of it."""
    return str(tomllib.loads(_shipped()[name].read_text(encoding="utf-8"))["scene"]["title"])


def find(name: str) -> Path:
    """File of a scene: one that comes with the program, or a path to a .toml file; raises SceneError."""
    path = _shipped().get(name, Path(name))
    if path.is_file() and (path.suffix == ".toml" or not path.suffix):
        return path
    if path.is_file():
        from tribodyn.geometry.sources.foreign_file import ENDINGS  # not needed to read a scene

        raise SceneError(f'"{name}" is no scene: scenes end in .toml; inspect and new open {", ".join(ENDINGS)}')
    if path.suffix == ".toml":
        raise SceneError(f'there is no scene file "{name}"')
    raise SceneError(f'there is no scene "{name}": the scenes are {", ".join(names())}, or give a path to a .toml file')


def read(name: str, overrides: Sequence[str] = ()) -> SceneFile:
    """Read and check a scene.

    name : name of a scene that comes with the program, or path of a .toml file
    overrides : texts "section.key=value", the value as TOML or, failing that, as it stands
    Raises  SceneError: one sentence that names the file, the key and what is expected"""
    path = find(name)
    return parse(_text(path, "scene"), path.name, overrides, path.resolve().parent)


def tables(path: Path, kind: str) -> dict[str, Any]:
    """The tables of a TOML file of a study, fit, ...; raises SceneError for one that cannot be read."""
    return deepcopy(_tables(_text(path, kind), path.name))


def _text(path: Path, kind: str) -> str:
    try:
        return text_of(path)
    except OSError as error:
        raise SceneError(f'the {kind} file "{path}" cannot be read as text ({error})') from None


@lru_cache(maxsize=4)  # a study changes one scene many times
def _tables(text: str, label: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also a number too long, brackets in each other too often
        raise SceneError(f"{label} is not valid TOML: {str(error)[0].lower()}{str(error)[1:]}") from None


def parse(text: str, label: str, overrides: Sequence[str] = (), folder: Path = CASES) -> SceneFile:
    """Check the text of a scene; label names it in errors. Raises SceneError."""
    data = dict(_tables(text, label))
    for override in overrides:
        _override(data, override)
    return SceneFile(Path(label).stem, text, tuple(overrides), folder, checked(kind_of(data), data, label, folder))


def checked(kind: type[Kind], data: dict[str, Any], label: str, folder: Path | None = None) -> Kind:
    """The data of a file as a table of a kind; raises SceneError that names the file `label` and the keys.

    folder : of a scene, where the laws and parts of one's own that it names lie"""
    try:
        return kind.model_validate(data, context=None if folder is None else {"folder": folder})
    except ValidationError as error:
        problems = _problems(error, data)
        remainder = f"; and {len(problems) - MOST_PROBLEMS} more" if len(problems) > MOST_PROBLEMS else ""
        raise SceneError(f"{label}: {'; '.join(problems[:MOST_PROBLEMS])}{remainder}") from None


def kind_of(data: dict[str, Any]) -> type[Scene]:
    """A scene with a [model] is one of matrices, another one has a mesh, perhaps of one sector of a wheel."""
    if "model" in data:
        return MatrixScene
    if isinstance(data, dict) and all(data.get(name) is None for name in ("wheel", "mistuning", "flow")):
        return MeshScene
    from tribodyn.workflows.scene.wheel_scene import WheelScene  # only wheels need it

    return WheelScene


def from_json(text: str) -> Scene:
    """The scene that a result holds, as `Scene.model_dump_json` wrote it; raises SceneError for another version's."""
    data = json.loads(text)
    try:
        return kind_of(data).model_validate(data)
    except ValidationError as trouble:
        reason = _problems(trouble, data)[0].partition(",")[0]
        raise SceneError(
            f"the scene of this result is of another version of tribodyn ({reason}): run it again"
        ) from None


def _override(data: dict[str, Any], text: str) -> None:
    """Put "section.key=value" into a parsed file, making tables anew on the way; an empty value takes the key out."""
    key, equals, value = text.partition("=")
    path = key.strip().split(".")
    if not equals or not all(path):
        raise SceneError(f'--set expects section.key=value, got "{text}"')
    table = data
    for name in path[:-1]:
        inner = table.get(name, {})
        if not isinstance(inner, dict):
            raise SceneError(f'--set {text}: "{name}" is not a table of the scene')
        table[name] = table = dict(inner)
    if not value.strip():
        table.pop(path[-1], None)
        return
    try:
        table[path[-1]] = _tables.__wrapped__(f"value = {value}", text)["value"]
    except SceneError:
        table[path[-1]] = value.strip()


def _problems(error: ValidationError, data: Any) -> list[str]:
    """A clause for each problem; where a value may be of several kinds, for that which it comes closest to."""
    closest_first = sorted(error.errors(), key=lambda problem: problem["type"].endswith("_type"))
    places = [(_place(problem, data), problem) for problem in closest_first]
    refused = [place for place, problem in places if problem["type"] != "missing"]
    sentences: dict[tuple[Any, ...], str] = {}
    for place, problem in places:
        inside = any(len(other) > len(place) and other[: len(place)] == place for other in refused)
        if not inside and not (problem["type"] == "missing" and place[:-1] in refused):
            sentences.setdefault(place, _sentence(problem, place))
    return list(sentences.values())


def _place(problem: Any, data: Any) -> tuple[str | int, ...]:
    """Keys and list positions that lead to a problem, without the names of kinds that pydantic puts between them."""
    place: list[str | int] = []
    *way, last = problem["loc"] or [""]
    for item in (*way, last):
        inside = data if isinstance(data, dict) else dict(enumerate(data)) if isinstance(data, (list, tuple)) else {}
        if item in inside:
            place.append(item)
            data = inside[item]
    return (*place, last) if problem["type"] == "missing" else tuple(place)


def _sentence(problem: Any, place: tuple[str | int, ...]) -> str:
    """One clause out of a problem that pydantic found: the key, what was expected, what was given."""
    kind, value, context, key = problem["type"], problem["input"], problem.get("ctx", {}), _key(place)
    if kind == "missing":
        return f"{key} is missing"
    if kind == "value_error":
        error = context["error"]
        if isinstance(error, UnknownKey):
            return unknown_key(_key((*place, error.key)), error.names)
        return str(error) if key in str(error) else f"{key}: {error}"
    limits = {"greater_than": ("gt", "above"), "greater_than_equal": ("ge", "at least")}
    limits |= {"less_than": ("lt", "below"), "less_than_equal": ("le", "at most")}
    if kind in limits:
        bound, word = limits[kind]
        return f"{key}: expected a value {word} {context[bound]:g}, got {value!r}"
    if kind == "literal_error":
        return f"{key}: expected {context['expected']}, got {value!r}"
    expected = {
        "string_type": "a text in quotes",
        "int_type": "a whole number",
        "bool_type": "true or false",
        "model_type": "a table",
        "dict_type": "a table",
        "tuple_type": "a list",
        "too_long": "a shorter list",
        "too_short": "a longer list",
    }.get(kind)
    return f"{key}: {f'expected {expected}' if expected else problem['msg'].lower()}, got {value!r}"


def _key(location: Sequence[str | int]) -> str:
    """Dotted key of a location, list positions in brackets."""
    key = ""
    for item in location:
        key += f"[{item}]" if isinstance(item, int) else f".{item}" if key else item
    return key or "the scene"


Source = SceneFile | str | PathLike[str] | Mapping[str, Any]
"""A scene: one that was read, a name that `scene_names` lists, the path of a .toml file, or its tables as a dict."""

AnyPath = str | PathLike[str]
"""A file or a folder."""

Overrides = Sequence[str] | Mapping[str, Any]
"""Changes of keys: ["wear.step=5 %"] or {"wear.step": "5 %"}; None takes a key out."""


def read_scene(source: Source, overrides: Overrides = (), *, folder: str | PathLike[str] | None = None) -> SceneFile:
    """Read and check a scene; quantities are numbers in SI units or texts with a unit, such as "20 kN".

    source : name, path of a .toml file, tables as a dict, or a scene that was read before
    overrides : keys to change, on top of those that the scene has
    folder : where relative file names of a dict begin, the current folder by default
    Raises  SceneError: one sentence that names the key and what is expected"""
    texts = override_texts(overrides)
    if isinstance(source, SceneFile):
        return parse(source.text, f"{source.name}.toml", (*source.overrides, *texts), source.folder)
    if isinstance(source, Mapping):
        text = tomli_w.dumps(_plain(source))
        return parse(text, "scene.toml", texts, Path(folder or ".").resolve())
    return read(str(source), texts)


def override_texts(overrides: Overrides) -> tuple[str, ...]:
    """Changes of keys as the texts "section.key=value" of the command line."""
    if isinstance(overrides, str):
        raise Refusal(f'overrides is "{overrides}": give a list of texts "section.key=value" or a dict')
    if not isinstance(overrides, Mapping):
        return tuple(overrides)
    texts = {
        key: "" if v is None else tomli_w.dumps({"v": _plain(v)}).partition("=")[2] for key, v in overrides.items()
    }
    return tuple(f"{key}={' '.join(line.strip() for line in text.strip().splitlines())}" for key, text in texts.items())


def _plain(value: Any) -> Any:
    """A value as TOML has it: arrays as lists, paths as texts; keys whose value is None are left out."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return str(value) if isinstance(value, PathLike) else value

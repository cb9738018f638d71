"""Pages made from the program itself: the keys of a scene, the commands, the layout of a result, the folders."""

from __future__ import annotations

import ast
import dataclasses
import json
import re
import textwrap
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, get_args, get_origin

from cyclopts import App
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from proof.bench import pages as bench, problem
from tribodyn.geometry import parts
from tribodyn.geometry.sources import abaqus_cards, ansys, nastran
from tribodyn.geometry.sources.card_table import words as words_of
from tribodyn.hbm import continuation
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.wear import law as wear_law
from tribodyn.plugins import PluginKind
from tribodyn.workflows.command.main import app
from tribodyn.workflows.result import store
from tribodyn.workflows.scene import json_schema
from tribodyn.workflows.scene.fields import Direction, Quantity
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.wheel_scene import WheelScene

ROOT = Path(__file__).parents[1]
GATHERED = ("parameters", "by_state")  # keys that others are gathered in
AXES = get_args(Direction)[1]
BOUNDS = (("gt", "above"), ("ge", "at least"), ("lt", "below"), ("le", "at most"))


def version() -> str:
    """Version of the program."""
    return str(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"])


def write(folder: Path) -> None:
    """Write all of them; a page that has not changed is left alone, so that Sphinx does not read it again."""
    folder.mkdir(exist_ok=True)
    pages = {
        "scene_with_a_mesh": scene_keys(WheelScene),
        "scene_of_matrices": scene_keys(MatrixScene, without=WheelScene),
        "parts": parameters_of(map(parts.load, parts.names())),
        "continuations": numbers_of(continuation.KIND),
        "contact_laws": numbers_of(contact_law.KIND),
        "wear_laws": numbers_of(wear_law.KIND),
        "commands": commands(app),
        "result": result_layout(),
        "cards": cards(),
        "folders": folders(),
        "lines": lines_by_folder(),
        "bench": "\n".join([bench.table(problem.names()), "", *map(bench.page, problem.names())]),
    }
    (folder / "scene.schema.json").write_text(json.dumps(json_schema.json_schema(), indent=1))
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


# Keys of a scene


def scene_keys(kind: type[BaseModel], without: type[BaseModel] | None = None) -> str:
    """A section for each table of a scene; tables that the scene `without` has just so are left out."""
    lines: list[str] = []
    for path, table in _tables(kind, ()):
        if without is not None and any(path == other and table is shared for other, shared in _tables(without, ())):
            continue
        lines += [f"## `[{'.'.join(path)}]`", "", _paragraph(table.__doc__), ""]
        meaning_of = json_schema.meanings(table)
        keys = [(name, field) for name, field in table.model_fields.items() if _is_key(name, field, path)]
        rows = [_row(name, field, meaning_of.get(name)) for name, field in keys]
        lines += _table(("key", "unit", "default", "meaning"), rows)
    return "\n".join(lines)


def _tables(kind: type[BaseModel], path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], type[BaseModel]]]:
    """Every table below a table, with its dotted path; NAME stands for a name that the scene chooses."""
    if path:
        yield path, kind
    for name, field in kind.model_fields.items():
        table = _inner(field.annotation)
        if table is None or _is_value(table):
            continue
        named = "NAME" if _is_mapping(field.annotation) else None
        yield from _tables(table, (*path, name, *filter(None, [named])))


def _is_value(table: type[BaseModel]) -> bool:
    """Whether a table stands for a value that is written as a text or a small inline table."""
    return table.__name__ in ("Place", "WearStepLimit", "Variable", "StateTable")


def _is_key(name: str, field: Any, path: tuple[str, ...]) -> bool:
    table = _inner(field.annotation)
    return (table is None or _is_value(table)) and name not in GATHERED


def _inner(annotation: Any) -> type[BaseModel] | None:
    """The first table inside an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((table for inner in get_args(annotation) if (table := _inner(inner))), None)


def _is_mapping(annotation: Any) -> bool:
    return get_origin(annotation) is dict or any(_is_mapping(inner) for inner in get_args(annotation))


def _row(name: str, field: Any, meaning: str | None) -> tuple[str, ...]:
    marks = [*field.metadata, *_marks(field.annotation)]
    if not meaning:
        raise ValueError(f"the key {name} of a scene has no meaning written below it")
    units = [mark.unit for mark in marks if isinstance(mark, Quantity)]
    axes = AXES in marks
    unit = ("ratio" if units[0] == "" else units[0]) if units else "axis" if axes else ""
    bounds = [f"{word} {getattr(mark, key):g}" for mark in marks for key, word in BOUNDS if hasattr(mark, key)]
    choices = [repr(choice).replace("'", '"') for choice in _choices(field.annotation)]
    notes = [f"One of {', '.join(f'`{c}`' for c in choices)}." if choices else "", _bounds(bounds)]
    return f"`{name}`", unit, _default(field), " ".join(filter(None, [_paragraph(meaning), *notes]))


def _bounds(bounds: list[str]) -> str:
    return f"{' and '.join(dict.fromkeys(bounds)).capitalize()}." if bounds else ""


def _marks(annotation: Any) -> Iterator[Any]:
    """Marks of Annotated types anywhere inside an annotation."""
    yield from getattr(annotation, "__metadata__", ())
    for inner in get_args(annotation):
        yield from _marks(inner)


def _choices(annotation: Any) -> tuple[Any, ...]:
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    return next((choices for inner in get_args(annotation) if (choices := _choices(inner))), ())


def _default(field: Any) -> str:
    if field.is_required():
        return "required"
    value = field.default_factory() if field.default_factory else field.default
    if value is None or value is PydanticUndefined or value in ((), {}, ""):
        return ""
    if isinstance(value, BaseModel):
        parts = {key: part for key, part in value.model_dump().items() if part is not None}
        return '`"peak"`' if parts == {"peak": 1.0} else f"`{parts}`"
    if isinstance(value, tuple):
        value = list(value)
    text = str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else repr(value)
    return "`" + text.replace("'", '"') + "`"


# Parameters that a file declares


def parameters_of(modules: Iterable[ModuleType]) -> str:
    """A section for each module that declares a dataclass of parameters, with defaults and meanings."""
    lines: list[str] = []
    for module in modules:
        kind = module.Parameters
        lines += [f"## `{module.__name__.rpartition('.')[2]}`", "", _paragraph(_head(module)), ""]
        meanings = _meanings(kind)
        rows = []
        for item in dataclasses.fields(kind):
            default = "" if item.default is dataclasses.MISSING or item.default is None else f"`{item.default!r}`"
            rows.append((f"`{item.name}`", default, _paragraph(meanings.get(item.name, ""))))
        lines += _table(("key", "default", "meaning"), rows)
    return "\n".join(lines)


def numbers_of(kind: PluginKind) -> str:
    """A section for each file of a kind, with the numbers that it declares; none is run for it."""
    lines: list[str] = []
    for path in map(kind.file_of, kind.names()):
        head = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0]
        lines += [f"## `{path.stem}`", "", _paragraph(head), ""]
        rows = []
        for number in kind.declared(path.stem):
            default = "required" if number.required else "" if number.default is None else f"`{number.default:g}`"
            limits = (("at least", number.low), ("above", number.above), ("at most", number.high))
            bounds = [f"{word} {limit:g}" for word, limit in limits if limit is not None]
            meaning = " ".join(filter(None, [_paragraph(number.meaning), _bounds(bounds)]))
            rows.append((f"`{number.name}`", number.unit or ("" if number.integer else "ratio"), default, meaning))
        lines += _table(("key", "unit", "default", "meaning"), rows) or ["It has no numbers of its own.", ""]
    return "\n".join(lines)


def _head(documented: ModuleType | type) -> str:
    return (documented.__doc__ or "").strip().split("\n\n")[0]


def _meanings(kind: type) -> dict[str, str]:
    """Meaning of every name in the lines "name, name : meaning; name : meaning" of a docstring."""
    meanings: dict[str, str] = {}
    text = re.sub(r"\n {4,}", " ", textwrap.dedent("    " + (kind.__doc__ or "")))
    names = {item.name for item in dataclasses.fields(kind)}
    for line in text.splitlines():
        for piece in re.split(r"; (?=\w+(?:, \w+)* : )", line):
            names_text, colon, meaning = piece.partition(" : ")
            listed = [name.strip() for name in names_text.split(",")]
            if colon and names.issuperset(listed):
                meanings |= dict.fromkeys(listed, meaning.strip())
    return meanings


# Commands


def commands(program: App) -> str:
    """A section for each command, from the help that the command itself prints."""
    lines: list[str] = []
    for name, command in _words(program, ""):
        lines += [f"## `tribodyn {name}`", "", _paragraph(command.help.split("Parameters:\n")[0]), ""]
        arguments = command.assemble_argument_collection(parse_docstring=True)
        rows = []
        for argument in arguments:
            names = [argument.name] if argument.required and argument.index is not None else argument.names
            words = ", ".join(f"`{name.lstrip('-').upper() if argument.index is not None else name}`" for name in names)
            rows.append((words, _argument_default(argument), _paragraph(argument.parameter.help or "")))
        lines += _table(("argument", "default", "meaning"), rows)
    return "\n".join(lines)


def _words(program: App, before: str) -> Iterator[tuple[str, App]]:
    """Every word that does something, with those of its groups before it."""
    for name in sorted(word for word in program if not word.startswith("-")):
        command = program[name]
        if command.default_command is None:
            yield from _words(command, f"{before}{name} ")
        else:
            yield f"{before}{name}", command


def _argument_default(argument: Any) -> str:
    if argument.required:
        return "required"
    value = argument.field_info.default
    return "" if value in (None, (), False) or value is argument.field_info.empty else f"`{value}`"


# The result file


def result_layout() -> str:
    """A section for each group of the result file, with dimensions and units of its arrays."""
    lines: list[str] = []
    for name, (kind, arrays) in store.SCHEMA.items():
        lines += [f"## `/{name}`", "", _paragraph(_head(kind)), ""]
        meanings = _meanings(kind)
        rows = []
        for item in dataclasses.fields(kind):
            shape, unit = arrays.get(item.name, (None, ""))
            where = " x ".join(shape) if shape is not None else "attribute"
            rows.append((f"`{item.name}`", where, unit, _paragraph(meanings.get(item.name, ""))))
        lines += _table(("name", "dimensions", "unit", "meaning"), rows)
    return "\n".join(lines)


# Cards of decks


def cards() -> str:
    """A section for each format of a deck: what is read of it, what is harmless, and what leaves no word."""
    lines: list[str] = []
    for name, table in (
        ("Abaqus and CalculiX", abaqus_cards.TABLE),
        ("Nastran", nastran.TABLE),
        ("ANSYS", ansys.TABLE),
    ):
        uses = {"read": table.reads, **{f"not used: {reason}": words_of(of) for reason, of in table.harmless.items()}}
        uses["of no effect"] = table.silents
        rows = [(use, ", ".join(f"`{card}`" for card in sorted(of))) for use, of in uses.items()]
        lines += [f"## {name}", "", *_table(("what becomes of it", "cards"), rows)]
        rows = [
            (f"`{card}`", table.parameters.get(card, "").replace("|", " or "), names)
            for card, names in table.fields.items()
        ]
        lines += _table(("card", "its parameters", "fields of a data line"), rows)
    return "\n".join(lines)


# The house

TOP = ("geometry", "fem", "reduction", "hbm", "workflows", "tests")
BEFORE = {"geometry": 2028, "fem": 1589, "reduction": 1779, "hbm": 8762, "workflows": 12839, "tests": 12161}


def folders() -> str:
    """Every folder with the first sentence of its docstring."""
    rows = []
    for top in TOP:
        inside = sorted({path.parent for path in (ROOT / top).rglob("*.py")}) if top != "tests" else []
        rows += [(f"`{path.relative_to(ROOT)}/`", _paragraph(_head_of(path))) for path in inside]
    rows += [(f"`tests/{room}/`", meaning) for room, meaning in TEST_ROOMS.items() if (ROOT / "tests" / room).is_dir()]
    return "\n".join(_table(("folder", "what it holds"), rows))


def _head_of(folder: Path) -> str:
    head = ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""
    if not head:
        raise ValueError(f"{folder} says in no docstring what it holds")
    return head.split("\n")[0]


TEST_ROOMS = {
    "cases": "What the shipped cases publish and reproduce.",
    "documentation": "Pages do what they print; their numbers are those of data and code; the start script.",
    "fem": "Tests of `fem`.",
    "geometry": "Tests of `geometry`.",
    "hbm": "Tests of `hbm`.",
    "helpers": "Models, random problems and tools that several tests share.",
    "properties": "Properties that hold over random problems and scenes.",
    "reduction": "Tests of `reduction`.",
    "workflows": "Tests of `workflows`, those that start a process included.",
}


def lines_by_folder() -> str:
    """Lines of Python, before and now; the rooms of workflows one by one."""
    rows = [(f"`{top}/`", str(BEFORE[top]), str(_lines(ROOT / top))) for top in TOP]
    rows += [
        (f"`workflows/{room.name}/`", "", str(_lines(room)))
        for room in sorted((ROOT / "workflows").iterdir())
        if (room / "__init__.py").exists()
    ]
    return "\n".join(_table(("folder", "before", "now"), rows))


def _lines(folder: Path) -> int:
    return sum(len(path.read_text().splitlines()) for path in folder.rglob("*.py"))


def _paragraph(text: str | None) -> str:
    """Text of a docstring as one paragraph of Markdown."""
    plain = " ".join((text or "").split())
    pieces = re.split(r"(`[^`]*`)", plain)
    return "".join(p if p.startswith("`") else re.sub(r"([*_|<>\[\]$])", r"\\\1", p) for p in pieces)


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    if not rows:
        return []
    lines = [f"| {' | '.join(cells)} |" for cells in (head, ("---",) * len(head), *rows)]
    return [*lines, ""]

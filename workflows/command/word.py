"""A word of the command line, made from a study: its options from the parameters, its help from the docstring.

A study is a function with one result type, which has `record()` for machines, `lines()` for people and, where there are
tables or pictures, `write(folder)`. A parameter that is marked with a quantity takes a text with a unit."""

from __future__ import annotations

import inspect
import json
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from cyclopts import App, Parameter

from tribodyn.extras import MissingPackage, package
from tribodyn.output_file import printable
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.result import store
from tribodyn.workflows.run.progress import Progress, console_progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import Quantity
from tribodyn.workflows.studies.study_result import DefectInRuns, StudyResult

NAMES = {"start": "--from", "stop": "--to", "overrides": "--set"}
Into = Literal["results", "pictures", "here", "asked"]
SUPPLIED = ("progress", "folder", "overrides")  # parameters that are not given as options of their own names
Overrides = Annotated[
    tuple[str, ...],
    Parameter(name="--set", negative=(), consume_multiple=False, help="Change a key of the scene: section.key=value."),
]
Json = Annotated[bool, Parameter(name="--json", negative=(), help="Print JSON for machines.")]
Flag = Annotated[bool, Parameter(negative=())]
SAMPLES = {  # parameter -> what an example gives it
    "scene": "beam", "study": "study.toml", "task": "fit.toml", "result": "results/beam", "file": "part.step",
    "source": "part.step", "measurement": "measured.csv", "first": "face.csv", "pristine": "new.csv",
    "worn": "worn.csv",
}  # fmt: skip


@dataclass(frozen=True)
class Option:
    """A parameter of a study as an option of its word.

    by_position : whether the study takes it by position; unit : of a quantity, None for what is none
    is_repeated : whether it takes several values"""

    name: str
    hint: Any
    default: Any
    by_position: bool
    unit: str | None = None
    is_repeated: bool = False

    @classmethod
    def of(cls, parameter: inspect.Parameter, hint: Any) -> Option:
        """The option of a parameter with its type."""
        unit = next((mark.unit for mark in _marks(hint) if isinstance(mark, Quantity)), None)
        bare = _not_none(get_args(_not_none(hint))[0] if get_origin(_not_none(hint)) is Annotated else _not_none(hint))
        origin, by_position = get_origin(bare), parameter.kind is not inspect.Parameter.KEYWORD_ONLY
        return cls(parameter.name, bare, parameter.default, by_position, unit, origin is Sequence)

    @property
    def positional(self) -> bool:
        """Whether it is given by its place: a scene, a result or another file."""
        return self.by_position and self._kind is not None

    @property
    def _kind(self) -> Any:
        if self.hint == scene_file.Source:
            return str
        return Path if PathLike[str] in get_args(self.hint) else None

    @property
    def flag(self) -> str:
        """Such as --points; several values are given one at a time, under the name of one."""
        name = self.name.removesuffix("s") if self.is_repeated and self.unit is None else self.name
        return NAMES.get(self.name, f"--{name.replace('_', '-')}")

    def parameter(self, meaning: str) -> inspect.Parameter:
        """The parameter of the word."""
        required = self.default is inspect.Parameter.empty
        if self.positional:
            annotation: Any = Annotated[self._kind if required else self._kind | None, Parameter(help=meaning)]
            place = inspect.Parameter.POSITIONAL_OR_KEYWORD
            return inspect.Parameter(self.name, place, default=self.default, annotation=annotation)
        kind, default = self._kind or self.hint, self.default
        is_integer = self.is_repeated and get_args(self.hint)[:1] == (int,)
        if self.is_repeated and self.unit is None:
            kind, default = tuple[int, ...] if is_integer else tuple[str, ...], default if required else default or ()
        elif self.unit is not None:
            kind, default = str, f"{default:g} {self.unit}".strip() if isinstance(default, (int, float)) else default
        if default is None:
            kind = kind | None
        plain = () if self.is_repeated or kind is bool else None
        shown = Parameter(name=self.flag, help=meaning, negative=plain, consume_multiple=is_integer)
        annotation = Annotated[kind, shown]
        return inspect.Parameter(self.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)

    def value(self, texts: Any) -> Any:
        """What the study takes."""
        if texts is None or self.unit is None:
            return texts
        if self.is_repeated:
            return tuple(quantity(self.flag, text.strip(), self.unit) for text in texts.split(","))
        return quantity(self.flag, texts, self.unit)


def word(study: Callable[..., Any], words: str, *, into: Into = "results") -> Callable[..., None]:
    """Make the function behind a word of the command line.

    words : such as "curve backbone"
    into : default folder of tables and pictures where --out is not given: results/NAME, pictures/ of the result, the
        folder of the file, or none"""
    hints = get_type_hints(study, include_extras=True)
    parameters = inspect.signature(study).parameters
    options = [Option.of(p, hints[name]) for name, p in parameters.items() if name not in SUPPLIED]
    help_texts = meanings(study.__doc__ or "", list(parameters))
    return_type = hints["return"]
    kinds = get_args(return_type) or (return_type,)
    writes = "folder" in parameters or all(hasattr(kind, "write") for kind in kinds)

    def call(*positional: Any, **by_keyword: Any) -> None:
        bound = signature.bind(*positional, **by_keyword)
        bound.apply_defaults()
        texts = dict(bound.arguments)
        out, as_json, overrides = texts.pop("out", None), texts.pop("as_json"), texts.pop("overrides", None)
        quiet = texts.pop("quiet", False)
        make_room(out)
        first = next((texts[option.name] for option in options if option.positional), None)
        folder = out or _folder(first, into)
        if writes and folder is not None and into != "here":
            try:
                package("matplotlib")
            except MissingPackage as missing:
                print(f"no pictures, tables alone: {missing}", file=sys.stderr)
        values = {option.name: option.value(texts[option.name]) for option in options}
        if overrides is not None:
            values["overrides"] = overrides
        if "progress" in parameters:
            values["progress"] = Progress() if as_json or quiet else console_progress()
        if "folder" in parameters:
            values["folder"] = folder
        try:
            result = study(**values)
        except KeyboardInterrupt:
            if "fresh" not in parameters:
                raise
            raise KeyboardInterrupt(f"stopped; finished runs are in {folder}: the same command resumes") from None
        if hasattr(result, "write"):
            files = [] if folder is None else result.write(folder)
        else:
            files = list(getattr(result, "files", ()))
        print_result(result, files, as_json)

    shown = [option.parameter(help_texts.get(option.name, "")) for option in options]
    keyword = inspect.Parameter.KEYWORD_ONLY
    if "overrides" in parameters:
        shown.append(inspect.Parameter("overrides", keyword, default=(), annotation=Overrides))
    if writes:
        meaning = help_texts.get("folder", _OUT[into])
        out = Annotated[Path | None, Parameter(name="--out", help=meaning)]
        shown.append(inspect.Parameter("out", keyword, default=None, annotation=out))
    shown.append(inspect.Parameter("as_json", keyword, default=False, annotation=Json))
    if "progress" in parameters:
        shown.append(inspect.Parameter("quiet", keyword, default=False, annotation=QUIET))
    call.__name__ = words.split()[-1].replace("-", "_")
    required = [option for option in options if option.positional and option.default is inspect.Parameter.empty]
    given = ["turbine" if words.startswith("wheel") else SAMPLES[option.name] for option in required]
    call.example = " ".join(["Example: tribodyn", words, *given])  # type: ignore[attr-defined]
    call.__doc__ = summary(study.__doc__ or "", list(parameters))
    call.__signature__ = signature = inspect.Signature(sorted(shown, key=lambda p: p.kind))  # type: ignore[attr-defined]
    call.__annotations__ = {p.name: p.annotation for p in shown}
    return call


def group(name: str, *words: Any) -> App:
    """Words of one kind, each made by `word`; the example of the first is that of them all."""
    app = App(name=name, help_epilogue=words[0].example)
    for call in words:
        app.command(call, help_epilogue=call.example)
    return app


QUIET = Annotated[Flag, Parameter(help="Print no progress.")]
_OUT = {
    "results": "Folder of tables and pictures; results/NAME by default.",
    "pictures": "Folder of tables and pictures; pictures/ beside the result by default.",
    "here": "Folder of what is written; that of the file by default.",
    "asked": "Folder of tables and pictures; none are written by default.",
}


def print_result(result: StudyResult, files: Sequence[Path] = (), as_json: bool = False) -> None:
    """Print a result of a study, as JSON or as lines, and the files that hold it.

    Raises  SolveFailed where the result has a sentence in `failure`; DefectInRuns where a run was stopped by a defect
    """
    if as_json:
        record = result.record()
        if isinstance(record, dict) and files:
            record = {**record, "files": [str(path) for path in files]}
        print(json.dumps(record, indent=2))
    else:
        print(*map(printable, (*result.lines(), *files)), sep="\n")
    if failure := getattr(result, "failure", ""):
        raise SolveFailed(failure)
    if result.defects:
        raise DefectInRuns("; ".join(result.defects))


def meanings(doc: str, names: Sequence[str]) -> dict[str, str]:
    """Meaning of each name in the lines "name, name : meaning; name : meaning" of a docstring."""
    meanings_by_name: dict[str, str] = {}
    for line in re.sub(r"\n {4,}", " ", inspect.cleandoc(doc)).splitlines():  # each with those that continue it
        for piece in re.split(r"; (?=\w+(?:, \w+)* : )", line):
            names_text, colon, meaning = piece.partition(" : ")
            listed = [name.strip() for name in names_text.split(",")]
            if colon and set(names).issuperset(listed):
                text = meaning.strip().rstrip(".")
                meanings_by_name |= dict.fromkeys(listed, f"{text[:1].upper()}{text[1:]}.")
    return meanings_by_name


def summary(doc: str, names: Sequence[str]) -> str:
    """A docstring without the meanings of parameters and what follows these."""
    lines = []
    for line in inspect.cleandoc(doc).splitlines():
        head = line.partition(" : ")[0]
        if line.startswith(("Raises  ", "Returns ", "Source  ")) or set(names).issuperset(head.split(", ")):
            break
        lines.append(line)
    return "\n".join(lines).strip()


def _folder(first: Any, into: str) -> Path | None:
    if into in ("asked", "here"):
        return None if into == "asked" else Path(first).parent
    if into == "results":
        return Path("results") / (Path(first).name.removesuffix(".toml") if first is not None else "study")
    return store.result_file(first).parent / "pictures"


def _not_none(hint: Any) -> Any:
    """A type without None."""
    if get_origin(hint) in (Union, UnionType) and type(None) in get_args(hint):
        return Union[tuple(member for member in get_args(hint) if member is not type(None))]  # noqa: UP007  # of one: itself
    return hint


def _marks(hint: Any) -> Iterator[Any]:
    yield from getattr(hint, "__metadata__", ())
    for inner in get_args(hint):
        yield from _marks(inner)


def quantity(name: str, text: str, unit: str) -> float:
    """The value of an option in SI units; raises Refusal that names the option."""
    from tribodyn.workflows.scene.units import to_si

    try:
        return to_si(text, unit)
    except Refusal as error:
        raise Refusal(f"{name}: {error}") from None


def make_room(out: Path | None, endings: Sequence[str] = ()) -> None:
    """Check, before long work, that --out can be written: a folder, or a file with one of these endings.

    Raises  Refusal"""
    if out is None:
        return
    if endings and out.suffix.lower() not in endings:
        raise Refusal(f"--out {out}: give a file that ends with {' or '.join(endings)}")
    if endings and out.is_dir():
        raise Refusal(f"--out {out}: a folder is there, give a file")
    folder = out.parent if endings else out
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refusal(f"--out {out}: no folder can be made at {folder}, {str(error.strerror).lower()}") from None

"""Numbers that a file declares as its own: contact and wear laws, parts, continuations, also those beside a scene.

A file says them in one class, each with its unit and its limits, and no other file names them:

    @dataclass(frozen=True)
    class Parameters:
        friction: float = number("", low=0.0)  # a pure number, needed
        "Coulomb coefficient."
        hardening: float = number("N/m", default=0.0, low=0.0)

They are read from the text of the file, which is not run for it: a scene can be checked without running its files.
A part or a continuation may leave units out; a number then takes what it is given, see `workflows.scene.own`.
"""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tribodyn.refusal import Refusal


def number(
    unit: str = "",
    *,
    default: Any = MISSING,
    low: float | None = None,
    above: float | None = None,
    high: float | None = None,
) -> Any:
    """A number of a `Parameters` class, as a keyword field of its dataclass.

    unit : SI unit such as "N/m", "" for a pure number; default : its value where it is not given, needed without one
    low, high : least and largest value allowed; above : it must be larger than that
    """
    limits = {"low": low, "above": above, "high": high}
    return field(default=default, kw_only=True, metadata={"unit": unit, **limits})


@dataclass(frozen=True)
class Number:
    """A declared number.

    unit : None where the file states none; default : None where it is needed, or is no plain number
    needed : whether it has to be given; whole : whether it is an integer; meaning : the text below it
    """

    name: str
    unit: str | None = None
    default: float | None = None
    needed: bool = False
    whole: bool = False
    low: float | None = None
    above: float | None = None
    high: float | None = None
    meaning: str = ""

    def fault(self, value: Any) -> str:
        """What is wrong with a value or with one in an array, as the end of a sentence; empty where nothing is."""
        values = np.atleast_1d(np.asarray(value, float)).ravel()
        for bad, words in (
            (~np.isfinite(values), "a finite number"),
            (values < (-np.inf if self.low is None else self.low), f"a value at least {self.low}"),
            (values <= (-np.inf if self.above is None else self.above), f"a value above {self.above}"),
            (values > (np.inf if self.high is None else self.high), f"a value at most {self.high}"),
        ):
            if bad.any():
                return f"expected {words}, got {values[bad][0]:g}"
        return ""


TYPES = ("int", "float")  # fields of other types, such as how Newton's method is set, are not for a scene


@cache
def read(path: Path, kind: str = "Parameters") -> tuple[Number, ...]:
    """The numbers that the class `kind` of a Python file declares, in their order; the file is not run.

    A class of a file beside it, as in `class Parameters(rough.Parameters)`, has declared its own before.
    kind : "Parameters" of a part or a law, "Options" of a continuation

    Raises  ValueError where the file cannot be read as Python
    """
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, SyntaxError, ValueError) as error:
        raise Refusal(f"'{path.name}' cannot be read as Python: {error}") from None
    found = next((node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == kind), None)
    if found is None:
        return ()
    beside = [base.value for base in found.bases if isinstance(base, ast.Attribute) and base.attr == kind]
    files = [path.with_name(f"{ast.unparse(name)}.py") for name in beside]
    numbers = [one for file in files if file.is_file() for one in read(file, kind)]
    for node, after in zip(found.body, [*found.body[1:], None], strict=True):
        if isinstance(node, ast.AnnAssign) and ast.unparse(node.annotation) in TYPES:
            numbers.append(_number(ast.unparse(node.target), node, _text(after)))
    return tuple(numbers)


@cache
def constant(path: Path, name: str) -> Any:
    """The literal that a Python file assigns to a name, None where it does not; the file is not run."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and any(ast.unparse(target) == name for target in node.targets):
            return _literal(node.value)
    return None


def _number(name: str, node: ast.AnnAssign, meaning: str) -> Number:
    whole = ast.unparse(node.annotation) == "int"
    call = node.value
    if isinstance(call, ast.Call) and ast.unparse(call.func).rpartition(".")[2] == "number":
        said = {key.arg: _literal(key.value) for key in call.keywords if key.arg is not None}
        unit = _literal(call.args[0]) if call.args else said.pop("unit", "")
        return Number(name, unit, needed="default" not in said, whole=whole, meaning=meaning, **said)
    return Number(name, default=_literal(call), needed=call is None, whole=whole, meaning=meaning)


def _literal(node: ast.expr | None) -> Any:
    """The value of a literal, None for what is not one."""
    try:
        return None if node is None else ast.literal_eval(node)
    except ValueError:
        return None


def _text(node: ast.stmt | None) -> str:
    """The text that a statement is, if it is one."""
    value = node.value if isinstance(node, ast.Expr) else None
    return " ".join(value.value.split()) if isinstance(value, ast.Constant) and isinstance(value.value, str) else ""


def checked(numbers: tuple[Number, ...], given: Mapping[str, Any], owner: str) -> dict[str, Any]:
    """The numbers of an owner in their declared order, defaults filled in; arrays are checked entry by entry.

    owner : for sentences, such as "contact law 'jenkins'"
    Raises  ValueError: one is missing, unknown, not finite or out of its limits
    """
    known = [n.name for n in numbers]
    for name in given:
        if name not in known:
            has = f"its numbers are {', '.join(known)}" if known else "it has none"
            raise Refusal(f"{owner} has no number {name}: {has}")
    values = {}
    for n in numbers:
        if n.name not in given and n.needed:
            raise Refusal(f"{owner} needs {n.name}: its numbers are {', '.join(known)}")
        values[n.name] = given.get(n.name, n.default)
        if n.fault(values[n.name]):
            raise Refusal(f"{owner}, {n.name}: {n.fault(values[n.name])}")
    return values


def require_limits(own: Any, owner: str) -> None:
    """Raise ValueError where a number of an instance of a class of declared numbers is out of its limits.

    owner : for the sentence, such as "adaptive continuation"
    """
    for item in fields(own):
        if "unit" in item.metadata:
            fault = Number(item.name, **item.metadata).fault(getattr(own, item.name))
            if fault:
                raise Refusal(f"{owner}, {item.name}: {fault}")


@cache
def run_file(path: Path, what: str, needs: tuple[str, ...]) -> ModuleType:
    """Run a Python file as a module of its own; the same file is run once.

    what : of the file, such as "contact law"; needs : functions that it must have
    Raises  ValueError where there is no such file, it fails, or a function is missing
    """
    if not path.is_file():
        raise Refusal(f"there is no {what} file '{path}'")
    name = f"tribodyn_own_{path.stem}_{abs(hash(path.resolve())):x}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # a file of one's own may be anything
        del sys.modules[name]
        raise Refusal(f"{what} file '{path}' cannot be run: {error}") from error
    for function in needs:
        if not callable(getattr(module, function, None)):
            raise Refusal(f"{what} file '{path}' has no function {function}")
    return module

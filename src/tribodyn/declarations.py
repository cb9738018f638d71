"""Numbers that a file declares: contact and wear laws, parts, continuations, also those of a user beside a scene.

A file declares them in one class, each with its unit, its limits and, where the program has to find it, its role:

    @dataclass(frozen=True)
    class Parameters:
        mu: float = number("", role="friction", low=0.0)  # dimensionless, required
        "Coefficient of friction."
        hardening: float = number("N/m", default=0.0, low=0.0)

No other file knows their names. They are read from the text of the file, which is not run: a scene is checked without
running its files. A part or a continuation may leave units out; see `workflows.scene.user_files`."""

import ast
import hashlib
import importlib.util
import sys
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from enum import StrEnum, auto
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tribodyn.consent import require_consent
from tribodyn.refusal import Refusal


class Role(StrEnum):
    """What a number of a law does: the program finds it by its role, never by its name."""

    FRICTION = auto()
    """Coefficient of friction [-]: a pair slips where its tangential force reaches this times its normal force."""
    SLIP_FORCE = auto()
    """Tangential force at which a pair slips whatever its normal force is [N]."""
    NORMAL_LOAD = auto()
    """Normal force of a pair, where the law has no normal component [N]."""
    AREA = auto()
    """Area of a pair [m2]; a scene fills in the tributary area."""
    ASPERITY_RADIUS = auto()
    """Radius of asperities [m]; a scene fills in that of its measured faces."""
    WEAR_COEFFICIENT = auto()
    """Factor of proportion of a wear law: the depth is proportional to it."""
    ACCURACY = auto()
    """How fine the steps of a wear rule are: a refined run has a smaller one."""


SLIP_LIMITS = (Role.FRICTION, Role.SLIP_FORCE)  # a pair slips later in proportion to these


def number(
    unit: str = "",
    *,
    role: str = "",
    default: Any = MISSING,
    low: float | None = None,
    above: float | None = None,
    high: float | None = None,
    usual: tuple[float, float] | None = None,
) -> Any:
    """A number of a `Parameters` class, as a keyword field of its dataclass.

    unit : SI unit such as "N/m", "" if dimensionless; role : one of `Role`, where the number has one
    default : its value where none is given; without a default the number is required
    low, high : least and largest value allowed; above : the value must be larger than this
    usual : range outside of which a value is noted"""
    limits = {"low": low, "above": above, "high": high, "usual": usual}
    return field(default=default, kw_only=True, metadata={"unit": unit, "role": role, **limits})


@dataclass(frozen=True)
class Number:
    """A declared number.

    unit : None where the file states none; role : None for a number that only its law knows
    default : None where the number is required, or its default is no literal
    required : whether a value must be given; integer : whether it is one; meaning : the text below it"""

    name: str
    unit: str | None = None
    role: str | None = None
    default: float | None = None
    required: bool = False
    integer: bool = False
    low: float | None = None
    above: float | None = None
    high: float | None = None
    usual: tuple[float, float] | None = None
    meaning: str = ""

    def fault(self, value: Any) -> str:
        """What is wrong with a value or an array of values, as the end of a sentence; empty if nothing is."""
        values = np.atleast_1d(np.asarray(value, float)).ravel()
        for is_wrong, expected in (
            (~np.isfinite(values), "a finite number"),
            (values < (-np.inf if self.low is None else self.low), f"a value at least {self.low}"),
            (values <= (-np.inf if self.above is None else self.above), f"a value above {self.above}"),
            (values > (np.inf if self.high is None else self.high), f"a value at most {self.high}"),
        ):
            if is_wrong.any():
                return f"expected {expected}, got {values[is_wrong][0]:g}"
        return ""


TYPES = ("int", "float")  # fields of other types, such as options of Newton's method, are not for a scene


@cache
def read(path: Path, class_name: str = "Parameters") -> tuple[Number, ...]:
    """The numbers that a class of a Python file declares, in their order; the file is not run.

    class_name : "Parameters" of a part or a law, "Options" of a continuation
    The numbers of a base class in a file of the same folder, as in `class Parameters(jenkins.Parameters)`, come first.

    Raises  Refusal where the file cannot be read as Python, or gives a number a role that does not exist"""
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, SyntaxError, ValueError) as error:
        raise Refusal(f"'{path.name}' cannot be read as Python: {error}") from None
    definition = next((node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == class_name), None)
    if definition is None:
        return ()
    bases = [base.value for base in definition.bases if isinstance(base, ast.Attribute) and base.attr == class_name]
    files = [path.with_name(f"{ast.unparse(base)}.py") for base in bases]
    numbers = [number for file in files if file.is_file() for number in read(file, class_name)]
    for node, following in zip(definition.body, [*definition.body[1:], None], strict=True):
        if isinstance(node, ast.AnnAssign) and ast.unparse(node.annotation) in TYPES:
            numbers.append(_number(ast.unparse(node.target), node, _text(following)))
            if numbers[-1].role not in (None, "", *Role):
                roles = ", ".join(Role)
                raise Refusal(f"'{path.name}', {numbers[-1].name}: no role '{numbers[-1].role}', there are {roles}")
    return tuple(numbers)


@cache
def constant(path: Path, name: str) -> Any:
    """The literal that a Python file assigns to a name, None where it assigns none; the file is not run."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and any(ast.unparse(target) == name for target in node.targets):
            return _literal(node.value)
    return None


def _number(name: str, node: ast.AnnAssign, meaning: str) -> Number:
    integer = ast.unparse(node.annotation) == "int"
    call = node.value
    if isinstance(call, ast.Call) and ast.unparse(call.func).rpartition(".")[2] == "number":
        keywords = {key.arg: _literal(key.value) for key in call.keywords if key.arg is not None}
        unit = _literal(call.args[0]) if call.args else keywords.pop("unit", "")
        return Number(name, unit, required="default" not in keywords, integer=integer, meaning=meaning, **keywords)
    return Number(name, default=_literal(call), required=call is None, integer=integer, meaning=meaning)


def _literal(node: ast.expr | None) -> Any:
    """The value of a literal, None for any other expression."""
    try:
        return None if node is None else ast.literal_eval(node)
    except ValueError:
        return None


def _text(node: ast.stmt | None) -> str:
    """The text of a statement that is a string."""
    value = node.value if isinstance(node, ast.Expr) else None
    return " ".join(value.value.split()) if isinstance(value, ast.Constant) and isinstance(value.value, str) else ""


def name_of(role: Role, numbers: Iterable[Number]) -> str | None:
    """The name of the number with a role, None where none has it."""
    return next((number.name for number in numbers if number.role == role), None)


def complete(numbers: tuple[Number, ...], values: Mapping[str, Any], owner: str) -> dict[str, Any]:
    """Values of all numbers of an owner in their declared order, with defaults; arrays are checked entry by entry.

    owner : for sentences, such as "contact law 'jenkins'"
    Raises  Refusal: a value is missing, belongs to no number, is not finite or out of its limits"""
    names = [number.name for number in numbers]
    for name in values:
        if name not in names:
            explanation = f"its numbers are {', '.join(names)}" if names else "it has none"
            raise Refusal(f"{owner} has no number {name}: {explanation}")
    result = {}
    for number in numbers:
        if number.name not in values and number.required:
            raise Refusal(f"{owner} needs {number.name}: its numbers are {', '.join(names)}")
        value = result[number.name] = values.get(number.name, number.default)
        if fault := number.fault(value):
            raise Refusal(f"{owner}, {number.name}: {fault}")
    return result


def require_limits(instance: Any, owner: str) -> None:
    """Refuse an instance of a class of declared numbers that has a value out of its limits.

    owner : for the sentence, such as "adaptive continuation"
    """
    for item in fields(instance):
        if "unit" in item.metadata:
            fault = Number(item.name, **item.metadata).fault(getattr(instance, item.name))
            if fault:
                raise Refusal(f"{owner}, {item.name}: {fault}")


@cache
def run_file(path: Path, title: str, functions: tuple[str, ...]) -> ModuleType:
    """Run a Python file as a module; the same file is run once.

    title : what the file is, such as "contact law"; functions : that it must define
    Raises  Refusal where there is no such file, it fails, a function is missing, or without the user's consent"""
    if not path.is_file():
        raise Refusal(f"there is no {title} file '{path}'")
    require_consent(path)
    # the same name in every process: kernels that numba has cached on disk refer to their module by it
    name = f"tribodyn_own_{path.stem}_{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:16]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise Refusal(f"the {title} file '{path}' is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # the code is the user's
        del sys.modules[name]
        raise Refusal(f"{title} file '{path}' cannot be run: {error}") from error
    for function in functions:
        if not callable(getattr(module, function, None)):
            raise Refusal(f"{title} file '{path}' has no function {function}")
    return module

"""What is wrong with the result of a fuzzed scene: a number that is not finite, a verdict that contradicts itself."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.result import store, summary
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import Verdict

MAY_LACK = (
    "patch.free_deflection", "stability.growth", "worn.omega", "worn.amplitude", "wear.preload_at_rest",
)  # fmt: skip
"""Arrays of a result that have nan where there is no number, as their classes say."""

MAY_BE_NEGATIVE = ("preload",)  # of a contact that is glued


def wrong(file: Path) -> str:
    """What is wrong with a result file, empty where nothing is."""
    result = store.load(file)
    for name, value in _numbers(result):
        if name not in MAY_LACK and not np.isfinite(value).all():
            return f"not finite: {name}"
    return "" if result.verdict is None else _of_verdict(result.verdict, summary.numbers(result))


def _numbers(result: Result) -> Iterator[tuple[str, Any]]:
    """Names and values of all real or complex numbers of a result, its arrays, its facts and its summary."""
    parts = {item.name: getattr(result, item.name) for item in fields(result)}
    for part, of in parts.items():
        if is_dataclass(of):
            for item in fields(of):
                yield from _within(f"{part}.{item.name}", getattr(of, item.name))
    summed = summary.numbers(result)
    del summed["verdict"], summed["changes"]  # inf is there "nobody knows"
    yield from _within("summary", summed)


def _within(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _within(f"{name}.{key}", item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _within(name, item)
    elif isinstance(value, (float, complex)) or (isinstance(value, np.ndarray) and value.dtype.kind in "fc"):
        yield name, value


def _of_verdict(verdict: Verdict, summed: dict[str, Any]) -> str:
    """What a verdict says that cannot be, or that the summary of its result contradicts."""
    frequency = summed["peak_frequency"]["first"] if summed["wear_steps"] else None
    summarised = {"life": None if summed["joints"] else summed["life"], "peak_frequency": frequency}
    for name, statement in verdict.statements.items():
        value, error = statement.value, statement.error
        other = summarised.get(name)
        agrees = value is None or other is None or isclose(value, other, rel_tol=0.01)
        trouble = (
            (statement.stated and value is None, "is stated without a value"),
            (value is not None and statement.stated and error is None, "is stated without an error"),
            (value is not None and not np.isfinite(value), "is no number"),
            (value is not None and value < 0 and name not in MAY_BE_NEGATIVE, "is negative"),
            (error is not None and not 0 <= error < np.inf, "has an error that is no number"),
            (
                statement.stated and error is not None and error > DEFAULT.largest,
                f"is stated with an error above {DEFAULT.largest:.0%}",
            ),
            (not agrees, "is not what the summary tells"),
        )
        for is_wrong, trouble_text in trouble:
            if is_wrong:
                return f"verdict: {name} {trouble_text}"
    return ""

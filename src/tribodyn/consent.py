"""Consent of the user to run scripts that a file names: Python files, drawings in Gmsh's language.

Running a scene is consent to run what the scene names. Functions that only open a file (inspect, plan, new, export,
verify) take `allow_scripts` and run nothing without it."""

from collections.abc import Callable
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

from tribodyn.refusal import Refusal

P = ParamSpec("P")
T = TypeVar("T")
_is_given: ContextVar[bool] = ContextVar("tribodyn_scripts", default=True)


def asks_consent(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function with a keyword `allow_scripts`: within it scripts run only where that is true."""

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        token = _is_given.set(bool(kwargs.get("allow_scripts", False)))
        try:
            return function(*args, **kwargs)
        finally:
            _is_given.reset(token)

    return guarded


def require_consent(script: Path) -> None:
    """Refuse to run a script without consent."""
    if not _is_given.get():
        raise Refusal(f"'{script}' is a script, which can do all that you can: read it, then add --allow-scripts")

"""Threads of BLAS: one, unless more are asked for.

The solver makes many small products; threads that wait for each other make them many times slower, and two pay nowhere
that was measured. So each entry of the solver is `single`, however it is called, and `limited` asks for another number.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")

_limit: ContextVar[int | None] = ContextVar("tribodyn_threads", default=None)  # None: nobody has limited them yet


@cache
def _controller() -> ThreadpoolController:
    """Of the libraries that are loaded; numpy's and scipy's are, once this package is imported."""
    import scipy.linalg  # noqa: F401

    return ThreadpoolController()


def usable(count: int) -> int:
    """As many of `count` threads as this process has processors: more wait for each other, a million for ever."""
    ours = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()  # Linux alone has it
    return min(count, ours or 1)


@contextmanager
def limited(count: int) -> Iterator[None]:
    """So many BLAS threads within the context, also in what is `single` there, but not more than `usable`."""
    count = usable(count)
    before = _limit.set(count)
    try:
        with _controller().limit(limits=count):
            yield
    finally:
        _limit.reset(before)


def single(function: Callable[P, R]) -> Callable[P, R]:
    """The function on one BLAS thread, unless it is called where their number is `limited` already."""

    @wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        if _limit.get() is not None:
            return function(*args, **kwargs)
        with limited(1):
            return function(*args, **kwargs)

    return wrapped

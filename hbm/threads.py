"""How many threads may work: one, unless more are asked for.

The solver makes many small products; BLAS threads that wait for each other make them many times slower, and two pay
nowhere that was measured. So each entry of the solver is `single`: BLAS has one thread in it, however it is called.
`limited` asks for more: BLAS has them outside of the solver."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")

_blas: ContextVar[int | None] = ContextVar("tribodyn_blas_threads", default=None)  # None: nobody has limited them yet


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
    """So many threads within the context, but not more than `usable`; BLAS has one of them in what is `single`."""
    limit = usable(count)
    before = _blas.set(limit)
    try:
        with _controller().limit(limits=limit):
            yield
    finally:
        _blas.reset(before)


def single(function: Callable[P, R]) -> Callable[P, R]:
    """The function on one BLAS thread."""

    @wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        if _blas.get() == 1:
            return function(*args, **kwargs)
        with limited(1):
            return function(*args, **kwargs)

    return wrapped

"""A second process for work that can be shared: a fork, which has all that this one has and sends what it finds."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import current_process, get_context
from typing import Any, TypeVar

from tribodyn.hbm import threads

T = TypeVar("T")

_work: Callable[[int], Any]  # of the fork that this process is

FORKS = hasattr(os, "fork") and sys.platform != "darwin"  # whose BLAS does not bear a fork


def two() -> bool:
    """Whether two processes may work here: so many threads are asked for, and this process may have one of its own."""
    return threads.asked() > 1 and FORKS and not current_process().daemon


def shared(work: Callable[[int], T], count: int, on_item: Callable[[int], None] | None = None) -> list[T]:
    """What `work` gives for 0 .. count - 1, every second one by another process where `two` may work.

    on_item : called with how many are done
    """
    found: dict[int, T] = {}

    def take(i: int, result: T) -> None:
        found[i] = result
        if on_item is not None:
            on_item(len(found))

    with _forked(work, range(1, count, 2) if two() else ()) as others:
        for i in range(count):
            if i not in others:
                take(i, work(i))
        for i, other in others.items():  # whatever went wrong there is met here, too
            take(i, work(i) if other.exception() else other.result())
    return [found[i] for i in range(count)]


@contextmanager
def _forked(work: Callable[[int], T], items: Any) -> Iterator[dict[int, Future[T]]]:
    """Items that a fork of this process works at; none where there is no room for one."""
    if not len(items):
        yield {}
        return
    pool = ProcessPoolExecutor(1, get_context("fork"), _begin, (work,))
    try:
        with warnings.catch_warnings():  # threads that draw a bar or compute: this fork needs none of them
            warnings.simplefilter("ignore", DeprecationWarning)
            futures = {i: pool.submit(_do, i) for i in items}
    except OSError:  # this process goes on alone
        futures = {}
    try:
        yield futures
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(work: Callable[[int], Any]) -> None:
    global _work
    _work = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started it ends it


def _do(i: int) -> Any:
    return _work(i)

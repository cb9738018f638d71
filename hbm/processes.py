"""A second process for work that can be shared: a fork, which has all that this one has and sends what it finds."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import current_process, get_context
from multiprocessing.connection import Connection
from typing import TypeVar

from tribodyn.hbm import threads

T = TypeVar("T")

FORKS = hasattr(os, "fork") and sys.platform != "darwin"  # whose BLAS does not bear a fork


def two() -> bool:
    """Whether two processes may work here: so many threads are asked for, and this process may have one of its own."""
    return threads.asked() > 1 and FORKS and not current_process().daemon


@contextmanager
def forked(body: Callable[[Connection], None]) -> Iterator[Connection]:
    """A fork of this process that calls `body` with a connection to write to, and ends with it or with the context.

    Yields the connection to read from: EOFError means that the fork has ended, or that there was no room for one
    """
    context = get_context("fork")
    reader, writer = context.Pipe(duplex=False)
    process = context.Process(target=_alone, args=(body, reader, writer), daemon=True)
    try:
        try:
            with warnings.catch_warnings():  # threads that draw a bar or compute: this fork needs none of them
                warnings.simplefilter("ignore", DeprecationWarning)
                process.start()
        except OSError:  # this process goes on alone
            pass
        finally:
            writer.close()
        yield reader
    finally:
        if process.pid is not None:
            process.kill()
            process.join()
        reader.close()


def _alone(body: Callable[[Connection], None], reader: Connection, writer: Connection) -> None:
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started it ends it
        reader.close()
        body(writer)
    finally:
        os._exit(0)  # whatever went wrong: the other process does without, and meets it too


def shared(work: Callable[[int], T], count: int, on_item: Callable[[int], None] | None = None) -> list[T]:
    """What `work` gives for 0 .. count - 1, every second one by another process where `two` may work.

    on_item : called with how many are done
    """
    found: dict[int, T] = {}

    def take(i: int, result: T) -> None:
        found[i] = result
        if on_item is not None:
            on_item(len(found))

    def send(writer: Connection) -> None:
        for i in range(1, count, 2):
            writer.send((i, work(i)))

    if two() and count > 1:
        with forked(send) as reader:
            for i in range(0, count, 2):
                take(i, work(i))
                _drain(reader, take, wait=False)
            _drain(reader, take, wait=True)
    for i in range(count):  # without another process, or what it has not done
        if i not in found:
            take(i, work(i))
    return [found[i] for i in range(count)]


def _drain(reader: Connection, take: Callable[[int, T], None], wait: bool) -> None:
    try:
        while wait or reader.poll():
            take(*reader.recv())
    except EOFError:
        return

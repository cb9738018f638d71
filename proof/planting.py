"""Plant faults in the functions of a running process that has loaded program and tests once.

Each fault is planted in a forked child, so that it ends with it: the code objects of the file's functions are replaced
by those of the changed text. Compiled functions are run uncompiled for that (NUMBA_DISABLE_JIT).
"""

from __future__ import annotations

import functools
import gc
import importlib
import json
import os
import resource
import sys
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numba
import numpy as np
import pytest

from proof import extremes, planted_faults, reference_runs
from proof.planted_faults import Fault, Seen

Send = Callable[[Any], None]
ACCESSORS = ("fget", "fset")
PLAIN = (bool, int, float, str, tuple, list, dict, frozenset, np.ndarray)  # constants of a module that may be replaced
BY_HAND = "by_hand"  # in the names of the tests that are run first
COMPILES = 600.0  # processor seconds for these tests where nothing is compiled yet
DEPTH = 5  # of decorators around a function


def serve(tree: Path, folder: Path, seconds: float, wanted: Sequence[int]) -> None:
    """Plant the faults of these numbers in turn; a row of each is kept in the folder and printed."""
    listed, rooms = planted_faults.faults()
    faults = [listed[number] for number in wanted]
    say = os.fdopen(os.dup(1), "w", buffering=1)
    _hush(folder / "printed")
    sys.path.insert(0, str(tree))
    files = list(dict.fromkeys(test for fault in faults for test in rooms[fault.room].tests))
    pytest.main(["--collect-only", "-q", *PYTEST, *files])  # loads everything
    if not numba.config.DISABLE_JIT:  # what they compile is kept for the children, whose clocks run
        first = [test for test in files if BY_HAND in test]
        in_child(partial(_tested, None, tree, first, ()), COMPILES)
    runs = tuple(dict.fromkeys(run for fault in faults for run in rooms[fault.room].runs))
    base = dict(reference_runs.numbers(runs))
    if failing := [name for name, found in base.items() if found is None]:
        raise RuntimeError(f"reference runs fail without a fault: {', '.join(failing)}")
    sound: dict[str, bool] = {}  # tests that have failed with a fault: whether they pass without one
    for fault in faults:
        room = rooms[fault.room]
        row = judged(fault, tree, room.tests, room.runs, base, seconds, sound)
        with (folder / planted_faults.ROWS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(row)) + "\n")
        by = row.tests or row.extremes or "unseen"
        say.write(f"{row.file}, {row.does}: {by}; changes {row.where or 'nothing'} by {row.change:.1e}\n")


def judged(
    fault: Fault,
    tree: Path,
    tests: tuple[str, ...],
    runs: tuple[str, ...],
    base: Mapping[str, reference_runs.Numbers | None],
    seconds: float,
    sound: dict[str, bool],
) -> Seen:
    """What sees a fault among tests (files), and what it changes in reference runs; base : their numbers without it.

    sound : tests that have failed with some fault, and whether they pass without one; is added to
    Raises  ValueError where the fault cannot be planted
    """
    if not in_child(partial(_planted, fault, tree), seconds):
        raise ValueError(f"{fault.file}: {fault.does}: this cannot be planted, see what is printed")
    clock = os.times()
    ordered = sorted(tests, key=lambda test: (BY_HAND not in test, Path(fault.file).stem not in test))
    by_test = _failing(fault, tree, ordered, seconds, sound)
    asked = not by_test and fault.file.startswith(planted_faults.SOLVED)
    by_extremes = next(iter(in_child(partial(_wrong, fault, tree), seconds)), "") if asked else ""
    change, where = _change(fault, tree, runs, base)
    now = os.times()
    spent = now.children_user + now.children_system - clock.children_user - clock.children_system
    return Seen(fault.file, fault.does, by_test, by_extremes, change, where, round(spent, 1))


PYTEST = ("-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow")


class First:
    """The first test that fails."""

    def __init__(self, send: Send):
        self._send = send

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Called by pytest."""
        if report.failed:
            self._send(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Called by pytest."""
        if report.failed:
            self._send(report.nodeid)


def _failing(fault: Fault, tree: Path, tests: Sequence[str], seconds: float, sound: dict[str, bool]) -> str:
    """The first test that fails with the fault, and not without it; "" where none does in the seconds."""
    while True:
        left_out = [f"--deselect={test}" for test, passes in sound.items() if not passes]
        found = next(iter(in_child(partial(_tested, fault, tree, tests, left_out), seconds)), "")
        if not found or sound.get(found):
            return found
        sound[found] = not in_child(partial(_tested, None, tree, [found], ()), 10 * seconds)
        if sound[found]:
            return found


def _planted(fault: Fault, tree: Path, send: Send) -> None:
    plant(fault, tree)
    send(True)


def _tested(fault: Fault | None, tree: Path, tests: Sequence[str], words: Sequence[str], send: Send) -> None:
    """Run tests, each on its own, as pytest would put files into an order of its own, until one fails."""
    if fault is not None:
        plant(fault, tree)
    os.chdir(tree)
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    for test in tests:
        if pytest.main(["-q", "-x", *PYTEST, *words, test], plugins=[First(send)]) == pytest.ExitCode.TESTS_FAILED:
            return


def _wrong(fault: Fault, tree: Path, send: Send) -> None:
    """Send the first wrong cell among some quick ones of extremes."""
    plant(fault, tree)
    for position, (model, varied, setting, judge) in enumerate(extremes.cells(quick=True)):
        if position % planted_faults.JUDGED:
            continue
        verdict = extremes.outcome_of(judge)
        if verdict.outcome == extremes.WRONG:
            send(f"{model}, {varied} {setting}: {verdict.reason}")
            return


def _change(
    fault: Fault, tree: Path, runs: tuple[str, ...], base: Mapping[str, reference_runs.Numbers | None]
) -> tuple[float, str]:
    """Largest relative change of a number of the reference runs, and whose."""

    def compared(send: Send) -> None:
        plant(fault, tree)
        for name, now in reference_runs.numbers(runs):
            before = base[name]
            if before is not None:
                change, where = reference_runs.change(before, now or {})
                send((change, f"{name}: {where}" if where else ""))

    found = in_child(compared, planted_faults.PROBED)
    if len(found) < len(runs):
        found.append((float("inf"), f"{runs[len(found)]} does not end"))
    return max(((change, where) for change, where in found), default=(0.0, ""))


def in_child(work: Callable[[Send], None], seconds: float) -> list[Any]:
    """What a piece of work sends from a forked child, until it ends or its processor seconds are spent."""
    reads, writes = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(reads)
        try:
            limit = int(process_time() + seconds) + 1
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            work(lambda found: _write(writes, found))
        except BaseException as failure:  # of a planted fault: it may be anything
            print(repr(failure), flush=True)
        finally:
            os._exit(0)
    os.close(writes)
    with os.fdopen(reads, encoding="utf-8") as file:
        lines = file.readlines()
    os.waitpid(pid, 0)
    return [json.loads(line) for line in lines]


def _write(writes: int, found: Any) -> None:
    os.write(writes, (json.dumps(found) + "\n").encode())


def plant(fault: Fault, tree: Path) -> None:
    """Give the functions and constants of a loaded module the text with the fault.

    What the process has kept of earlier calls is forgotten: it was found without the fault.
    Raises  ValueError where the text does not stand once in its file, or changes no function or constant
    """
    text = (tree / fault.file).read_text(encoding="utf-8")
    if text.count(fault.old) != 1:
        raise ValueError(f"{fault.file} does not hold this text exactly once: {fault.old}")
    name = "tribodyn." + fault.file.removesuffix(".py").replace("/", ".")
    module = importlib.import_module(name)
    fresh = types.ModuleType(name)
    fresh.__dict__.update(__name__=name, __file__=module.__file__, __package__=module.__package__)
    sys.modules[name] = fresh
    try:
        exec(compile(text.replace(fault.old, fault.new), str(module.__file__), "exec"), fresh.__dict__)
    finally:
        sys.modules[name] = module
    if not _recoded(module, fresh) + _reset(module, fresh):
        raise ValueError(f"{fault.file}: nothing of the loaded module changes with {fault.new}")
    for kept in gc.get_objects():
        if type(kept) is functools._lru_cache_wrapper:  # isinstance asks the referent of a proxy, which may be gone
            kept.cache_clear()


def _recoded(module: types.ModuleType, fresh: types.ModuleType) -> int:
    """Functions whose code has become another."""
    changed = 0
    new = dict(_functions(fresh))
    for place, function in _functions(module):
        other = new.get(place)
        if other is not None and other.__code__ != function.__code__:
            function.__code__ = other.__code__
            changed += 1
    return changed


def _reset(module: types.ModuleType, fresh: types.ModuleType) -> int:
    """Constants that have become others."""
    changed = [
        name
        for name, value in vars(fresh).items()
        if not name.startswith("__") and isinstance(value, PLAIN) and repr(value) != repr(vars(module).get(name))
    ]
    for name in changed:
        setattr(module, name, vars(fresh)[name])
    return len(changed)


def _functions(module: types.ModuleType) -> Iterator[tuple[str, types.FunctionType]]:
    """The functions and methods that a module defines, without what decorates them."""
    for name, value in list(vars(module).items()):
        if getattr(value, "__module__", None) != module.__name__:
            continue
        yield from _plain(name, value)
        if isinstance(value, type):
            for inner, member in list(vars(value).items()):
                yield from _plain(f"{name}.{inner}", member)


def _plain(name: str, value: Any) -> Iterator[tuple[str, types.FunctionType]]:
    if isinstance(value, classmethod | staticmethod):
        value = value.__func__
    elif isinstance(value, functools.cached_property):
        value = value.func
    if isinstance(value, property):
        for accessor in ACCESSORS:
            yield from _plain(f"{name}.{accessor}", getattr(value, accessor))
        return
    for _ in range(DEPTH):
        value = getattr(value, "py_func", None) or getattr(value, "__wrapped__", value)
    if isinstance(value, types.FunctionType):
        yield name, value


def _hush(path: Path) -> None:
    """Send what is printed from now on into a file."""
    place = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(place, 1)
    os.dup2(place, 2)


if __name__ == "__main__":
    serve(Path.cwd(), Path(sys.argv[1]), float(sys.argv[2]), [int(number) for number in sys.argv[3:]])

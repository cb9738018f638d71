"""Plant faults in the functions of a running process that has loaded program and tests once.

Each fault is planted in a forked child, so that it ends with it: the code objects of the file's functions are replaced
by those of the changed syntax tree. Compiled functions run uncompiled for that (NUMBA_DISABLE_JIT)."""

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

from proof import planted_faults, reference_runs
from proof.hard_settings import extremes
from proof.planted_faults import Detection, Fault, Room

Send = Callable[[Any], None]
ACCESSORS = ("fget", "fset")
PLAIN = (bool, int, float, str, tuple, list, dict, frozenset, np.ndarray)  # constants of a module that may be replaced
BY_HAND = "by_hand"  # in the names of the tests that are run first
COMPILE_SECONDS = 600.0  # processor seconds for these tests where nothing is compiled yet
DEPTH = 5  # of decorators around a function


def serve(tree: Path, folder: Path, seconds: float, numbers: Sequence[int]) -> None:
    """Plant the faults of these numbers in turn; a row of each is written into the folder and printed."""
    planned, rooms = planted_faults.faults()
    faults = [planned[number] for number in numbers]
    report = os.fdopen(os.dup(1), "w", buffering=1)
    _redirect_output(folder / "printed")
    sys.path.insert(0, str(tree))
    files = list(dict.fromkeys(test for fault in faults for test in rooms[fault.room].tests))
    pytest.main(["--collect-only", "-q", *PYTEST, *files])  # loads everything
    if not numba.config.DISABLE_JIT:  # what they compile is cached for the children, whose clocks run
        by_hand = [test for test in files if BY_HAND in test]
        in_child(partial(_send_failing_test, None, tree, by_hand, ()), COMPILE_SECONDS)
    runs = tuple(dict.fromkeys(run for fault in faults for run in rooms[fault.room].runs))
    reference = dict(reference_runs.numbers(runs))
    if failing := [name for name, values in reference.items() if values is None]:
        raise RuntimeError(f"reference runs fail without a fault: {', '.join(failing)}")
    sound: dict[str, bool] = {}
    for fault in faults:
        row = detect(fault, tree, rooms[fault.room], reference, seconds, sound)
        with (folder / planted_faults.ROWS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(row)) + "\n")
        detector = row.test or row.cell or "nothing"
        change = f"changes {row.number or 'nothing'} by {row.change:.1e}"
        report.write(f"{row.file}, {row.effect}: detected by {detector}; {change}\n")


def detect(
    fault: Fault,
    tree: Path,
    room: Room,
    reference: Mapping[str, reference_runs.Numbers | None],
    seconds: float,
    sound: dict[str, bool],
) -> Detection:
    """What detects a fault, and what it changes in the reference runs; reference : their numbers without it.

    sound : tests that have failed with some fault, and whether they pass without one; is extended
    Raises  ValueError where the fault cannot be planted"""
    if not in_child(partial(_send_planted, fault, tree), seconds):
        raise ValueError(f"{fault.file}: {fault.effect}: this cannot be planted, see what is printed")
    start = os.times()
    ordered = sorted(room.tests, key=lambda test: (BY_HAND not in test, Path(fault.file).stem not in test))
    test = _failing_test(fault, tree, ordered, seconds, sound)
    is_judged = not test and fault.file.startswith(planted_faults.SOLVER_FOLDERS)
    cell = next(iter(in_child(partial(_send_wrong_cell, fault, tree), seconds)), "") if is_judged else ""
    change, number = _largest_change(fault, tree, room.runs, reference)
    end = os.times()
    spent = end.children_user + end.children_system - start.children_user - start.children_system
    return Detection(fault.file, fault.effect, test, cell, change, number, round(spent, 1))


PYTEST = ("-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow")


class FirstFailure:
    """The first test that fails."""

    def __init__(self, send: Send):
        self._send = send

    def pytest_runtest_logreport(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        """Called by pytest."""
        if report.failed:
            self._send(report.nodeid)

    pytest_collectreport = pytest_runtest_logreport


def _failing_test(fault: Fault, tree: Path, tests: Sequence[str], seconds: float, sound: dict[str, bool]) -> str:
    """The first test that fails with the fault, and not without it; "" where none does in the seconds."""
    while True:
        deselected = [f"--deselect={test}" for test, passes in sound.items() if not passes]
        test = next(iter(in_child(partial(_send_failing_test, fault, tree, tests, deselected), seconds)), "")
        if not test or sound.get(test):
            return test
        sound[test] = not in_child(partial(_send_failing_test, None, tree, [test], ()), 10 * seconds)
        if sound[test]:
            return test


def _send_planted(fault: Fault, tree: Path, send: Send) -> None:
    plant(fault, tree)
    send(True)


def _send_failing_test(
    fault: Fault | None, tree: Path, tests: Sequence[str], options: Sequence[str], send: Send
) -> None:
    """Run the files of tests one by one, as pytest would sort them, until a test fails."""
    if fault is not None:
        plant(fault, tree)
    os.chdir(tree)
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    for test in tests:
        arguments = ["-q", "-x", *PYTEST, *options, test]
        if pytest.main(arguments, plugins=[FirstFailure(send)]) == pytest.ExitCode.TESTS_FAILED:
            return


def _send_wrong_cell(fault: Fault, tree: Path, send: Send) -> None:
    """Send the first wrong cell among some quick ones of extremes."""
    plant(fault, tree)
    for position, (model, varied, setting, judge) in enumerate(extremes.cells(quick=True)):
        if position % planted_faults.JUDGED_CELLS:
            continue
        verdict = extremes.outcome_of(judge)
        if verdict.outcome == extremes.WRONG:
            send(f"{model}, {varied} {setting}: {verdict.reason}")
            return


def _largest_change(
    fault: Fault, tree: Path, runs: tuple[str, ...], reference: Mapping[str, reference_runs.Numbers | None]
) -> tuple[float, str]:
    """Largest relative change of a number of the reference runs, and of which."""

    def send_changes(send: Send) -> None:
        plant(fault, tree)
        for name, values in reference_runs.numbers(runs):
            without_fault = reference[name]
            if without_fault is not None:
                change, number = reference_runs.change(without_fault, values or {})
                send((change, f"{name}: {number}" if number else ""))

    changes = in_child(send_changes, planted_faults.RUN_SECONDS)
    if len(changes) < len(runs):
        changes.append((float("inf"), f"{runs[len(changes)]} does not end"))
    return max(((change, number) for change, number in changes), default=(0.0, ""))


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
            work(lambda message: _write(writes, message))
        except BaseException as failure:  # a planted fault may raise anything
            print(repr(failure), flush=True)
        finally:
            os._exit(0)
    os.close(writes)
    with os.fdopen(reads, encoding="utf-8") as file:
        lines = file.readlines()
    os.waitpid(pid, 0)
    return [json.loads(line) for line in lines]


def _write(writes: int, message: Any) -> None:
    os.write(writes, (json.dumps(message) + "\n").encode())


def plant(fault: Fault, tree: Path) -> None:
    """Give the functions and constants of a loaded module those of the file with the fault.

    The caches of the process are cleared: they were filled without the fault.
    Raises  ValueError where the fault has no place, or changes no function or constant"""
    faulty = fault.faulty(tree)
    name = "tribodyn." + fault.file.removesuffix(".py").replace("/", ".")
    module = importlib.import_module(name)
    fresh = types.ModuleType(name)
    fresh.__dict__.update(__name__=name, __file__=module.__file__, __package__=module.__package__)
    sys.modules[name] = fresh
    try:
        exec(compile(faulty, str(module.__file__), "exec"), fresh.__dict__)
    finally:
        sys.modules[name] = module
    if not _replace_code(module, fresh) + _replace_constants(module, fresh):
        raise ValueError(f"{fault.file}: {fault.effect}: nothing of the loaded module changes by {fault.rule}")
    for item in gc.get_objects():
        if type(item) is functools._lru_cache_wrapper:  # isinstance asks the referent of a proxy, which may be dead
            item.cache_clear()


def _replace_code(module: types.ModuleType, fresh: types.ModuleType) -> int:
    """Replace the code of the functions that differ; their number."""
    changed = 0
    functions = dict(_functions(fresh))
    for place, function in _functions(module):
        faulty = functions.get(place)
        if faulty is not None and faulty.__code__ != function.__code__:
            function.__code__ = faulty.__code__
            changed += 1
    return changed


def _replace_constants(module: types.ModuleType, fresh: types.ModuleType) -> int:
    """Replace the constants that differ; their number."""
    changed = [
        name
        for name, value in vars(fresh).items()
        if not name.startswith("__") and isinstance(value, PLAIN) and repr(value) != repr(vars(module).get(name))
    ]
    for name in changed:
        setattr(module, name, vars(fresh)[name])
    return len(changed)


def _functions(module: types.ModuleType) -> Iterator[tuple[str, types.FunctionType]]:
    """The functions and methods that a module defines, without their decorators."""
    for name, value in list(vars(module).items()):
        if getattr(value, "__module__", None) != module.__name__:
            continue
        yield from _undecorated(name, value)
        if isinstance(value, type):
            for inner, member in list(vars(value).items()):
                yield from _undecorated(f"{name}.{inner}", member)


def _undecorated(name: str, value: Any) -> Iterator[tuple[str, types.FunctionType]]:
    if isinstance(value, classmethod | staticmethod):
        value = value.__func__
    elif isinstance(value, functools.cached_property):
        value = value.func
    if isinstance(value, property):
        for accessor in ACCESSORS:
            yield from _undecorated(f"{name}.{accessor}", getattr(value, accessor))
        return
    for _ in range(DEPTH):
        value = getattr(value, "py_func", None) or getattr(value, "__wrapped__", value)
    if isinstance(value, types.FunctionType):
        yield name, value


def _redirect_output(path: Path) -> None:
    """Append what is printed from now on to a file."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)


if __name__ == "__main__":
    serve(Path.cwd(), Path(sys.argv[1]), float(sys.argv[2]), [int(number) for number in sys.argv[3:]])

"""Runs of a study in the processes of a pool, where one that dies takes no other run with it, or on many machines."""

import gc
import logging
import os
import signal
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from multiprocessing import get_context, parent_process
from multiprocessing.context import BaseContext
from typing import TypeVar

from threadpoolctl import threadpool_limits

from tribodyn.extras import package
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.run import model_cache
from tribodyn.workflows.studies.many.run_task import RunRow, StudyRun

ATTEMPTS = 3  # of a run whose process dies, such as for want of memory
LOCAL = "local"  # the processes of this machine, which nobody else can reach: they take work through pipes
WAIT = "20s"  # for a scheduler to answer
_always = ExitStack()  # what a process of the pool is within as long as it lives

Work = TypeVar("Work", bound=StudyRun)


def finished(tasks: Sequence[Work], workers: int, solve: Callable[[Work], RunRow]) -> Iterator[RunRow]:
    """Rows as they come, made by `solve` of a module; a run whose process died ATTEMPTS times is lost.

    The death of one process ends the whole pool. Nobody tells which run killed it, so all that were under way are
    repeated one at a time: a run is lost by a death of its own only."""
    # Gmsh, once used in this process, sets this to the default: a pipe to a dead process would end the study
    if hasattr(signal, "SIGPIPE") and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # as Python begins
    processes = prepared()
    waiting, deaths = deque(tasks), Counter[int]()
    while waiting:
        one_at_a_time = deaths[waiting[0].number] > 0
        limit = 1 if one_at_a_time else min(workers, len(waiting))
        pool = ProcessPoolExecutor(limit, processes, _begin)
        under_way: dict[Future[RunRow], Work] = {}
        try:
            while under_way or (waiting and (deaths[waiting[0].number] > 0) == one_at_a_time):
                # no more than there are processes: what is under way when one dies is then known
                while waiting and len(under_way) < limit and (deaths[waiting[0].number] > 0) == one_at_a_time:
                    task = waiting.popleft()
                    try:
                        under_way[pool.submit(solve, task)] = task
                    except BrokenProcessPool:
                        waiting.appendleft(task)
                        raise
                done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in sorted(done, key=lambda f: isinstance(f.exception(), BrokenProcessPool)):
                    row = future.result()
                    del under_way[future]
                    yield row
        except BrokenProcessPool:
            for task in reversed(under_way.values()):
                deaths[task.number] += 1
                if deaths[task.number] < ATTEMPTS:
                    waiting.appendleft(task)
                else:
                    sentence = f"the process that worked on it died {ATTEMPTS} times, it was killed or short of memory"
                    yield RunRow(task.number, task.key, "lost", sentence)
        finally:
            _stop(pool)


def prepared() -> BaseContext:
    """How processes begin: where they are forked from a server, it imports what all need from this call on."""
    processes = get_context("forkserver" if sys.platform == "linux" else "spawn")
    if sys.platform == "linux":
        from multiprocessing import forkserver  # which Windows has not

        processes.set_forkserver_preload([__name__])
        forkserver.ensure_running()
    return processes


def _begin() -> None:
    """In every process of the pool: processes and threads do not multiply, and none outlives the study."""
    gc.freeze()  # what is imported is looked through no more
    threadpool_limits(1)
    _always.enter_context(model_cache.memory_cache())
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A study that is killed cannot end its processes: they would wait for its next task for ever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _stop(pool: ProcessPoolExecutor) -> None:
    """End the processes at once: who leaves early does not wait for runs that nobody will read."""
    processes = list((getattr(pool, "_processes", None) or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()
    for process in processes:
        process.join()


def on_cluster(tasks: Sequence[Work], address: str, solve: Callable[[Work], RunRow]) -> Iterator[RunRow]:
    """Rows as they come, by dask.distributed; all that is distributed about a study is its work.

    address : of a scheduler, such as tls://host:8786; what it sends is unpickled, so it must be the user's own
    Raises  Refusal: no scheduler answers there; SolveFailed: the scheduler was lost on the way"""
    distributed = package("distributed")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what is lost is told in one sentence
    try:
        client = distributed.Client(address, timeout=WAIT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise Refusal(f"--scheduler {address}: no scheduler answers there ({error})") from None
    try:
        by_future = {client.submit(solve, task, pure=False, priority=-i): task for i, task in enumerate(tasks)}
        for future in distributed.as_completed(list(by_future), loop=client.loop):
            task, failure = by_future.pop(future), future.exception() if future.status == "error" else None
            if failure is not None:  # the run itself raises nothing: its workers died, or cannot run it at all
                yield RunRow(task.number, task.key, "lost", " ".join(f"{type(failure).__name__}: {failure}".split()))
            elif future.status == "finished":
                yield future.result()
            else:
                raise SolveFailed(f"the scheduler at {address} was lost")
    finally:
        client.close()

"""Runs of a study on many machines by dask.distributed; all that is distributed about them is its work."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from typing import Any

from tribodyn.extras import package
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.studies.many.task import Row, Task, solve

LOCAL = "local"
WAIT = "20s"  # for a scheduler to answer


def finished(tasks: Sequence[Task], address: str, workers: int) -> Iterator[Row]:
    """Rows as they come.

    address : of a scheduler, such as tcp://host:8786, or "local" for a cluster of `workers` processes of its own
    Raises  ValueError: no scheduler answers there; SolveFailed: the scheduler was lost on the way
    """
    distributed = package("distributed")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what is lost is told in one sentence
    cluster = None
    if address == LOCAL:
        cluster = distributed.LocalCluster(workers, threads_per_worker=1, dashboard_address=None)
    try:
        client = distributed.Client(cluster or address, timeout=WAIT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ValueError(f"--scheduler {address}: no scheduler answers there ({error})") from None
    try:
        by_future = {client.submit(solve, task, pure=False, priority=-i): task for i, task in enumerate(tasks)}
        for future in distributed.as_completed(list(by_future), loop=client.loop):
            yield _row(future, by_future.pop(future), address)
    finally:
        client.close()
        if cluster is not None:
            cluster.close()


def _row(future: Any, task: Task, address: str) -> Row:
    if future.status == "finished":
        row: Row = future.result()
        return row
    if future.status == "error":  # the run itself raises nothing: its workers died, or cannot run it at all
        error = future.exception()
        return Row(task.number, task.key, "lost", " ".join(f"{type(error).__name__}: {error}".split()))
    raise SolveFailed(f"the scheduler at {address} was lost")

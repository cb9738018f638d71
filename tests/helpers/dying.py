"""What a process of a pool does instead of a run; by itself, because each process imports it anew."""

import os
import signal
import time

from tribodyn.workflows.studies.many.run_task import RunRow, StudyRun


def at_two(one: StudyRun) -> RunRow:
    """Refuse a run, or die of the second."""
    if one.number == 2:
        os.kill(os.getpid(), signal.SIGTERM)
    if one.number == 1:
        time.sleep(1.0)  # still under way when the second dies beside it
    return RunRow(one.number, one.key, "refused", "")

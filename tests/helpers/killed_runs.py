"""A run in a process of its own that can be killed: without the imports, which the server has done before."""

import signal
import time
from pathlib import Path

from tribodyn.workflows.result import store
from tribodyn.workflows.run import checkpoint, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import read

SPENT = "spent"  # in the folder of a run that came to its end: processor seconds that it took


def go_on(folder: Path, overrides: tuple[str, ...], killed_after: float = 0.0) -> None:
    """Begin the small beam in a folder, or resume it.

    killed_after : processor seconds, 0 for never; the kernel ends the process at them, in the middle of anything"""
    began = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, killed_after)
    path = folder / "result.h5"
    file = read("beam", overrides)
    earlier = store.load(path) if path.exists() else None
    if earlier is None or not checkpoint.is_complete(earlier, file.scene):
        pipeline.run(file, folder, Progress(), earlier)
    (folder / SPENT).write_text(str(time.process_time() - began))

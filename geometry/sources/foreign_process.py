"""Parsers of other projects (Gmsh, OpenCASCADE, meshio) at work in a child process, which hands back plain arrays.

A damaged file can end such a parser without a word, or keep it for ever; the child's death is one sentence here. A file
that is data is given to its parser through a link in an empty folder, under a name that this module gives it: files
that lie next to it, such as NAME.msh.opt, which Gmsh runs as a script, are not there."""

import ctypes
import importlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tribodyn.refusal import Refusal

SECONDS = 900.0  # for a file
_ANSWER = "answer.npz"


def call(module: str, function: str, path: Path, is_script: bool = False, **options: Any) -> Any:
    """What a function of a module, by its name, makes of a file, called in a child process.

    module : one of this folder has no dot
    The function takes a path and `options`, and returns nested dicts and lists of texts, numbers and arrays.
    is_script : the file names others by their place, so it is read where it lies
    Raises  Refusal: that of the function; the parser died, or it did not end"""
    with TemporaryDirectory(prefix="tribodyn-") as folder:
        place = path.absolute() if is_script else Path(folder) / f"file{path.suffix.lower()}"
        if not is_script:
            place.symlink_to(path.absolute())
        request = json.dumps([module, function, str(place), options, str(Path(folder) / _ANSWER)])
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        command = [sys.executable, "-P", "-m", __name__, request]
        try:
            child = subprocess.run(
                command, env=environment, cwd=None if is_script else folder, stdin=subprocess.DEVNULL,
                capture_output=True, text=True, errors="replace", timeout=SECONDS,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise Refusal(f"'{path}' was not read in {SECONDS:g} s: mesh it in Gmsh and give the mesh") from None
        if child.returncode < 0:
            name = signal.Signals(-child.returncode).name
            cure = "it is damaged or needs more memory than there is, write it again"
            raise Refusal(f"the parser of '{path}' was ended by {name}: {cure}")
        if child.returncode:
            raise RuntimeError(f"the parser of '{path}' failed with {child.returncode}\n{child.stderr}")
        content = _load(Path(folder) / _ANSWER)
    if "refusal" in content:
        raise Refusal(content["refusal"].replace(str(place), str(path)))
    return content["value"]


def _answer(module: str, function: str, path: str, options: dict[str, Any], answer: str) -> None:
    """In the child: call the function and write what it returns, or the sentence of its refusal."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: the child ends when its parent does
    try:
        place = module if "." in module else f"{__package__}.{module}"
        value = getattr(importlib.import_module(place), function)(path, **options)
        content = {"value": value}
    except Refusal as refusal:
        content = {"refusal": str(refusal)}
    _save(Path(answer), content)


def _save(path: Path, content: dict[str, Any]) -> None:
    arrays: list[np.ndarray] = []

    def numbered(array: Any) -> Any:
        arrays.append(np.asarray(array))
        return {"array": len(arrays) - 1}

    tree = json.dumps(content, default=numbered)
    np.savez(path, tree=np.array(tree), **{str(i): array for i, array in enumerate(arrays)})  # type: ignore[arg-type]


def _load(path: Path) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as arrays:

        def filled(table: dict[str, Any]) -> Any:
            number = table.get("array")
            return arrays[str(number)] if isinstance(number, int) else table

        content: dict[str, Any] = json.loads(str(arrays["tree"]), object_hook=filled)
        return content


if __name__ == "__main__":
    _answer(*json.loads(sys.argv[1]))

"""Start commands without loading the packages each time: a server that has loaded them forks a child for each.

A command of a page spends three to six seconds of a processor on imports, most of what many of them cost. The child has
the arguments, environment, folder and open files of who asked, and leaves with the command's exit code. The first
command of the README and the tests of start, kill and Ctrl-C run in interpreters of their own.

python -m tests.helpers.warm SOCKET serves until its standard input is closed."""

import atexit
import importlib
import json
import os
import pkgutil
import selectors
import signal
import socket
import subprocess
import sys
import tempfile
import types
from functools import cache
from pathlib import Path

from tests.helpers import compiled

ROOT = Path(__file__).parents[2]
LOADED = ("matplotlib.pyplot", "pyvista", "gmsh", "skfem", "PIL.Image", "scipy.stats", "scipy.interpolate")
LEFT_OUT = ("tribodyn.workflows.cases",)
THREADS = {name: "1" for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")}

CLIENT = """
import json, os, socket, sys
asks = socket.socket(socket.AF_UNIX)
asks.connect(sys.argv[1])
told = json.dumps([sys.argv[2:], os.getcwd(), dict(os.environ)]).encode()
socket.send_fds(asks, [len(told).to_bytes(8, "big")], [0, 1, 2])
asks.sendall(told)
asks.shutdown(socket.SHUT_WR)
sys.exit(int(asks.makefile().read() or 1))
"""
PROGRAM = """#!/bin/sh
exec "{python}" -I -S -c '{client}' "{socket}" "$@"
"""


@cache
def program() -> str:
    """The text of a shell script that runs its arguments in a child of this process's server."""
    folder = tempfile.TemporaryDirectory(prefix="warm")
    name = Path(folder.name, "socket")
    paths = os.pathsep.join((str(ROOT / "src"), str(ROOT)))
    environment = os.environ | THREADS | {"PYTHONPATH": paths, "MPLBACKEND": "agg"}
    environment.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    command = [sys.executable, "-m", "tests.helpers.warm", str(name)]
    server = subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    asks, says = server.stdin, server.stdout
    assert says.readline() == b"ready\n"

    def end() -> None:
        asks.close()
        server.wait()
        folder.cleanup()

    atexit.register(end)
    return PROGRAM.format(python=sys.executable, client=CLIENT, socket=name)


def serve(name: str) -> None:
    """Load the packages, then fork a child for each that asks, until standard input is closed."""
    load()
    with socket.socket(socket.AF_UNIX) as listens, selectors.DefaultSelector() as selector:
        listens.bind(name)
        listens.listen()
        print("ready", flush=True)
        selector.register(listens, selectors.EVENT_READ)
        selector.register(sys.stdin, selectors.EVENT_READ)
        while all(key.fileobj is listens for key, _ in selector.select()):
            asks, _ = listens.accept()
            with asks:
                if os.fork() == 0:
                    answer(asks)
            while True:  # children that have answered
                try:
                    if os.waitpid(-1, os.WNOHANG)[0] == 0:
                        break
                except ChildProcessError:
                    break


def load() -> None:
    """Import the product, as far as it does not know a case, and what it imports late."""
    import tribodyn

    for module in pkgutil.walk_packages(tribodyn.__path__, "tribodyn."):
        if not module.name.startswith(LEFT_OUT) and not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for word in LOADED:
        importlib.import_module(word)
    compiled.small_run()  # what a first run alone does, such as reading the kernels from disk


def answer(asks: socket.socket) -> None:
    """Run what is asked in a child of this process and tell its exit code; does not return."""
    size, files, _, _ = socket.recv_fds(asks, 8, 3)
    messages = b""
    while len(messages) < int.from_bytes(size, "big"):
        messages += asks.recv(1 << 16)
    pid = os.fork()
    if pid == 0:
        asks.close()
        code = 1
        try:
            code = child(files, *json.loads(messages))
        finally:
            os._exit(code)
    for file in files:
        os.close(file)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    asks.sendall(str(code if code >= 0 else 128 - code).encode())
    os._exit(0)


def child(files: list[int], arguments: list[str], folder: str, environment: dict[str, str]) -> int:
    """Be the program: `-c TEXT` runs Python, anything else is a command of tribodyn. Its exit code."""
    for place, file in enumerate(files):
        os.dup2(file, place)
    os.chdir(folder)
    saved = {name: os.environ[name] for name in (*THREADS, "PYTHONPATH", "VTK_DEFAULT_OPENGL_WINDOW", "MPLBACKEND")}
    os.environ.clear()
    os.environ.update(environment | saved)
    sys.modules["__main__"] = main = types.ModuleType("__main__")
    signal.signal(signal.SIGINT, signal.default_int_handler)
    code: object = 0
    try:
        if arguments[:1] == ["-c"]:
            sys.argv = ["-c", *arguments[2:]]
            sys.path.insert(0, "")
            exec(compile(arguments[1], "<string>", "exec"), main.__dict__)
        else:
            if arguments[:1] == ["prove"]:
                from proof.__main__ import main as command
            else:
                from tribodyn.__main__ import main as command

            sys.argv = ["tribodyn", *arguments[arguments[:1] == ["prove"] :]]
            command()
    except SystemExit as stop:
        code = stop.code
    except BaseException:  # as the interpreter shows it
        sys.excepthook(*sys.exc_info())
        code = 1
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    return code if isinstance(code, int) else int(code is not None)


if __name__ == "__main__":
    serve(sys.argv[1])

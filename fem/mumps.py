"""Solutions by MUMPS on several MPI processes, of a PETSc that another Python on the machine has, such as Debian's.

PETSc's binary packages belong to the system's Python, so that the factor lives in processes of that one. The matrix,
the right-hand sides and the solutions go through files that all of them map."""

import os
import shlex
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, cast

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.refusal import Refusal, SolverFailure

COMMAND = "TRIBODYN_MPI"  # of the environment: how a Python with PETSc is started
DEFAULT = "/usr/bin/python3"  # Debian's, one process
WORKER = Path(__file__).with_name("mumps_worker.py")
CURE = (
    "install PETSc for the system's Python (on Debian: apt-get install python3-petsc4py-real python3-mpi4py), and set "
    f'{COMMAND} to what starts it, such as "mpirun -n 2 /usr/bin/python3"'
)


class Mumps:
    """A Cholesky factor, or LDL^T where the matrix is indefinite, that lives in MPI processes until this is deleted.

    K : (n, n) symmetric. The environment's TRIBODYN_MPI is the command that starts the processes; one alone by default
    Raises  Refusal where PETSc cannot be started; ArithmeticError where a pivot is zero or negative; RuntimeError,
        as `solve`, where the processes end
    Source  MUMPS: Amestoy, Duff, Koster, L'Excellent 2001, doi 10.1137/S0895479899358194"""

    patience = 20.0  # seconds for the processes to end

    def __init__(self, K: csr_matrix, definite: bool = True) -> None:
        self._n = K.shape[0]
        self._folder = TemporaryDirectory(prefix="tribodyn-mumps-")
        folder = Path(self._folder.name)
        K.sort_indices()
        for name, array in (("rows", K.indptr), ("columns", K.indices), ("values", K.data)):
            np.save(folder / f"{name}.npy", array)
        if definite:
            (folder / "definite").touch()
        # the other Python has packages of its own, and each process one thread
        ours = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
        environment = {key: value for key, value in os.environ.items() if key not in ours}
        environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        command = shlex.split(os.environ.get(COMMAND, DEFAULT))
        self._errors = open(folder / "errors", "w+", encoding="utf-8")  # noqa: SIM115 - lives as long as the processes
        try:
            self._process = subprocess.Popen(
                [*command, str(WORKER), str(folder)],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, text=True, env=environment,
            )  # fmt: skip
        except OSError as trouble:
            raise Refusal(f"the solver mumps cannot start {command[0]} ({trouble.strerror}): {CURE}") from None
        self._input, self._output = cast("tuple[IO[str], IO[str]]", (self._process.stdin, self._process.stdout))
        words = self._answer()
        if words[:1] == ["trouble"]:
            raise ArithmeticError(f"MUMPS's error {words[1]}")
        if words[:1] != ["ready"]:
            raise Refusal(f"the solver mumps does not start{self._last_error()}: {CURE}")
        self.name = f"MUMPS of PETSc {words[2]}, {words[1]} MPI process{'es' if words[1] != '1' else ''}"

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        columns = np.asarray(rhs, float).reshape(self._n, -1)
        if not columns.size:
            return np.zeros(np.shape(rhs))
        folder = Path(self._folder.name)
        solution = np.memmap(folder / "found", np.float64, "w+", shape=columns.shape, order="F")
        right_side = np.memmap(folder / "rhs", np.float64, "w+", shape=columns.shape, order="F")
        right_side[:] = columns
        right_side.flush()
        try:
            self._input.write(f"{columns.shape[1]}\n")
            self._input.flush()
        except OSError:
            pass  # its last answer has the reason
        if self._answer() != ["solved"]:
            raise SolverFailure(f"the processes of MUMPS have ended{self._last_error()}")
        return np.array(solution, order="C").reshape(np.shape(rhs))

    def _answer(self) -> list[str]:
        """Words of the next line of the first process; none where it has ended."""
        return self._output.readline().split()

    def _last_error(self) -> str:
        """The last line of what they wrote as they ended."""
        self._process.wait()
        self._errors.seek(0)
        lines = [line.strip() for line in self._errors if line.strip(" -\n")]
        return f" ({lines[-1]})" if lines else ""

    def __del__(self) -> None:
        process = getattr(self, "_process", None)
        if process is not None and not sys.is_finalizing():
            for pipe in (process.stdin, process.stdout):
                pipe.close()  # without a next line they end
            try:
                process.wait(self.patience)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if hasattr(self, "_errors"):
            self._errors.close()

"""A factor by MUMPS in MPI processes of the system's Python: the same model, where PETSc is installed."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array, identity

from tests.helpers.fits import plain
from tribodyn.fem import mumps
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.workflows.scene import scene_file


def _petsc_is_there() -> bool:
    look = f"import glob, sys; sys.path += sorted(glob.glob('{mumps_places()}')); import petsc4py, mpi4py"
    try:
        return subprocess.run([mumps.DEFAULT, "-I", "-c", look], capture_output=True).returncode == 0
    except OSError:
        return False


def mumps_places() -> str:
    text = mumps.WORKER.read_text(encoding="utf-8")
    return next(line for line in text.splitlines() if line.startswith("PLACES")).split('"')[1]


installed = pytest.mark.skipif(not _petsc_is_there(), reason="the system's Python has no PETSc")
SMALL = ("geometry.n_patch=3", "geometry.n_length=6", "geometry.n_height=2", "reduction.modes=6")


@pytest.fixture
def two_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which("mpirun") is None:
        pytest.skip("there is no mpirun")
    for name in ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("OMPI_MCA_rmaps_base_oversubscribe", "1")
    started = subprocess.run(["mpirun", "-n", "2", "true"], capture_output=True, text=True, timeout=60)
    if started.returncode:
        pytest.skip(f"mpirun starts nothing: {started.stderr}")
    monkeypatch.setenv(mumps.COMMAND, f"mpirun -n 2 {mumps.DEFAULT}")


def spring_chain(n: int) -> csr_matrix:
    return csr_matrix(diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)))


@installed
@pytest.mark.usefixtures("two_processes")
def test_two_processes_give_the_model_of_the_direct_solver() -> None:
    rows = [plain(scene_file.read("beam", (*SMALL, f"reduction.solver={s}"))) for s in ("direct", "mumps")]
    assert "2 MPI processes" in str(rows[1].origin.factorisation)
    assert rows[1].free_frequency == pytest.approx(rows[0].free_frequency, rel=1e-9)
    K, base = (model.system.stiffness for model in rows)
    np.testing.assert_allclose(base, K, atol=1e-11 * np.abs(K).max())


@installed
def test_one_process_solves_what_is_definite_and_what_is_not() -> None:
    rhs = np.random.default_rng(0).normal(size=(40, 3))
    for matrix, definite in ((spring_chain(40), True), (spring_chain(40) - 0.7 * identity(40), False)):
        factor = factorise(matrix, definite, solver="mumps")
        assert "1 MPI process" in factor.name
        for b in (rhs, rhs[:, 0]):
            solution = factor.solve(b)
            assert solution.shape == b.shape
            np.testing.assert_allclose(matrix @ solution, b, atol=1e-12)


@installed
def test_a_singular_matrix_is_refused() -> None:
    free = spring_chain(20).tolil()
    free[0, 0] = free[19, 19] = 1.0
    with pytest.raises(SingularStiffness):
        factorise(csr_matrix(free), solver="mumps")


def test_without_petsc_the_cure_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for command, reason in ((str(tmp_path / "python"), "cannot start"), ("false", "does not start")):
        monkeypatch.setenv(mumps.COMMAND, command)
        with pytest.raises(ValueError, match=f"{reason}.*apt-get install python3-petsc4py-real"):
            factorise(spring_chain(5), solver="mumps")

"""The sparse factorisation, and with it every result, gives the same bits in every process."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigvalsh
from scipy.sparse import eye_array, random_array

from tests.helpers.digest import digest
from tribodyn.fem import factor
from tribodyn.fem.factor import Pardiso, eigenvalues_below, factorise, solve_selected

FRESH = """
import sys
from pathlib import Path
from tests.helpers.digest import digest
print(digest(Path(sys.argv[1])))
"""
WORN = """
import numpy as np, scipy.sparse as sp
from tribodyn.fem.factor import factorise
some = sp.random(300, 300, 0.05, random_state=0)
factorise(some @ some.T + 10 * sp.eye(300)).solve(np.ones(300))
"""


def test_an_unknown_solver_is_refused() -> None:
    with pytest.raises(ValueError, match="no solver 'umfpack': there are pardiso, superlu"):
        factorise(eye_array(3), solver="umfpack")


@pytest.mark.parametrize("pardiso", [True, False])
def test_eigenvalues_are_counted_by_one_factorisation(pardiso: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(factor, "pardiso_available", lambda: pardiso)
    item, other = (random_array((150, 150), density=0.05, rng=seed) for seed in (1, 2))
    K, M = item + item.T, other @ other.T + 2 * eye_array(150)
    values = eigvalsh(K.toarray(), M.toarray())
    for place in (1, 40, 75, 149):
        assert eigenvalues_below(K, M, 0.5 * (values[place - 1] + values[place])) == place


@pytest.mark.parametrize(("solver", "largest"), [("pardiso", 0.5), ("pardiso", 0.0), ("superlu", 0.5)])
def test_few_rows_are_those_of_the_whole_solution(solver: str, largest: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a force on them vanishes, between solutions in all rows, and where they are too many to pay."""
    monkeypatch.setattr(Pardiso, "MOST_SELECTED", largest)
    subset = random_array((400, 400), density=0.02, rng=1)
    K = subset @ subset.T + 4 * eye_array(400)
    small = np.array([3, 50, 51, 52, 399])
    built = factorise(K, solver=solver, selected_rows=small)
    assert getattr(built, "_selects", False) == (solver == "pardiso" and largest > 0)
    force, complete = np.zeros((400, 7)), np.random.default_rng(2).normal(size=(400, 2))
    force[small[:4], :2] = np.random.default_rng(3).normal(size=(4, 2))
    for _ in range(2):
        assert np.allclose(
            solve_selected(built, force)[small], np.linalg.solve(K.toarray(), force)[small], rtol=1e-10, atol=1e-14
        )
        assert np.allclose(built.solve(complete), np.linalg.solve(K.toarray(), complete), rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("before", ["", WORN], ids=["fresh", "after_other_work"])
def test_a_model_has_the_same_bits_in_every_process(before: str, tmp_path: Path) -> None:
    words = [sys.executable, "-c", before + FRESH, str(tmp_path)]
    run = subprocess.run(words, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == digest(tmp_path)
    assert run.stderr == ""

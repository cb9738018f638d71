"""The sparse factorisation, and with it every result, gives the same bits in every process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from scipy.sparse import eye_array

from tests.helpers.digest import digest
from tribodyn.fem.factor import factorise

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


@pytest.mark.parametrize("before", ["", WORN], ids=["fresh", "after_other_work"])
def test_a_model_has_the_same_bits_in_every_process(before: str, tmp_path: Path) -> None:
    words = [sys.executable, "-c", before + FRESH, str(tmp_path)]
    run = subprocess.run(words, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == digest(tmp_path)
    assert run.stderr == ""

"""Checked by time integration

The same model marched in time at its peak, beside the harmonic balance.
"""

from pathlib import Path

import tribodyn as td

COARSE = {
    "geometry.n_patch": 3,
    "geometry.n_length": 4,
    "geometry.n_height": 1,
    "reduction.modes": 4,
    "harmonics.kept": [0, 1],
    "verdict.enabled": False,
}

result = td.run("beam", overrides=COARSE | {"wear": None, "harmonics.kept": [0, 1, 2, 3]})
comparison = td.verify(result)
print(*comparison.lines()[:6], sep="\n")
comparison.write(Path())

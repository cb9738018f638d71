"""Hysteresis loops

Friction force over sliding of the pairs that dissipate most.
"""

import tribodyn as td

COARSE = {
    "geometry.n_patch": 3,
    "geometry.n_length": 4,
    "geometry.n_height": 1,
    "reduction.modes": 4,
    "harmonics.kept": [0, 1],
    "verdict.enabled": False,
}

result = td.run("beam", overrides=COARSE | {"wear": None})
td.plot.hysteresis(result).savefig("loops.png")

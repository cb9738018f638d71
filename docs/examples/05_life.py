"""Until the contact is lost

Preload against cycles: what is pressed less wears less, so that the last of the preload fades away.
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

result = td.run("beam", overrides=COARSE | {"wear.tolerance": "10 %"})
print(f"life {result.summary()['life'] / 1e6:.1f} million cycles")
td.plot.wear(result, "preload").savefig("preload.png")

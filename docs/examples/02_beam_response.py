"""A beam on a support

The response of the beam scene lies between that of the free beam and that of the stuck one.
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
print(f"{result.summary()['peak_frequency']['first']:.0f} Hz, {1e3 * result.summary()['amplitude']['first']:.2f} mm")
td.plot.response(result).savefig("response.png")

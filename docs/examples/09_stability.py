"""Where the curve is stable

Points of the response curve from which a vibration runs away are drawn in red.
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

judged = {"wear": None, "response.stability": True, "response.points": 12, "response.frequency": ["500 Hz", "1200 Hz"]}
result = td.run("beam", overrides=COARSE | judged)
print(f"{result.summary()['unstable_points']} of {len(result.response.frequency)} points are unstable")
td.plot.response(result).savefig("stability.png")

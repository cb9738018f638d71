"""A nonlinear mode

Frequency and damping of the stuck mode as its amplitude grows and friction sets in.
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

bone = td.studies.backbone("beam", 1e-6, 5e-4, overrides=COARSE)
bone.plot().savefig("backbone.png")

"""A fretting rig

Two specimens under preload; the machine prescribes the motion. Contact status over the patch.
"""

import tribodyn as td

coarse = {"reduction.modes": 6, "harmonics.kept": [0, 1], "response.points": 16, "verdict.enabled": False}
result = td.run("rig", overrides=coarse | {"wear": None})
td.plot.response(result).savefig("rig.png")

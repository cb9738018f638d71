"""A fretting rig

Two specimens under preload; the machine prescribes the motion. Contact status over the patch.
"""

import tribodyn as td

coarse = {"geometry.n_contact_length": 3, "reduction.modes": 6, "harmonics.kept": [0, 1], "response.points": 16}
result = td.run("rig", overrides=coarse | {"verdict.enabled": False, "wear": None})
td.plot.response(result).savefig("rig.png")

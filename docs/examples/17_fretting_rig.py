"""A fretting rig

Two specimens under preload; the machine prescribes the motion. The response, and the contact at its peak.
"""

import tribodyn as td

coarse = {"geometry.n_contact_length": 3, "reduction.modes": 6, "harmonics.kept": [0, 1], "response.points": 24}
coarse |= {"verdict.enabled": False, "wear": None, "response.method": "natural"}
result = td.run("rig", overrides=coarse)
print(f"peak at {result.summary()['peak_frequency']['first']:.0f} Hz")
td.plot.response(result).savefig("rig.png")
td.plot.patch(result).savefig("rig_patch.png")

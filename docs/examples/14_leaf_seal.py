"""A leaf seal that hammers

A normal contact alone that opens and closes: the response bends.
"""

import tribodyn as td

coarse = {"geometry.n_column": 7, "geometry.pin_column": 2, "response.points": 24, "verdict.enabled": False}
result = td.run("leaf_seal", overrides=coarse | {"response.stability": False})
print(f"peak at {result.summary()['peak_frequency']['first']:.1f} Hz")
td.plot.response(result).savefig("leaf_seal.png")

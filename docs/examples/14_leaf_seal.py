"""A leaf seal that hammers

A normal contact alone that opens and closes: the response bends.
"""

import tribodyn as td

result = td.run("leaf_seal", overrides={"verdict.enabled": False, "response.points": 24})
print(f"peak at {result.summary()['peak_hz'][0]:.1f} Hz")
td.plot.response(result).savefig("leaf_seal.png")

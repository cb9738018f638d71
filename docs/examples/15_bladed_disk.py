"""A bladed disk

One sector of a wheel whose blades rub at their shrouds; engine order 1 drives it.
"""

import tribodyn as td

result = td.run("blade", overrides={"wear": None, "response.points": 30, "verdict.enabled": False})
print(f"peak at {result.summary()['peak_frequency']['first']:.1f} Hz")
td.plot.response(result).savefig("blade.png")

"""A wear map after a million cycles

Wear goes on until a million cycles are done. The map shows what is worn off where.
"""

import numpy as np

import tribodyn as td

COARSE = {
    "geometry.n_patch": 3,
    "geometry.n_length": 4,
    "geometry.n_height": 1,
    "reduction.modes": 4,
    "harmonics.kept": [0, 1],
    "verdict.enabled": False,
}

result = td.run("beam", overrides=COARSE | {"geometry.n_patch": 5, "wear.tolerance": "5 %", "wear.max_steps": 12})
wear = result.wear
row = int(np.searchsorted(wear.cycles, 1e6))
print(f"after {wear.cycles[row] / 1e6:.2f} million cycles: {1e6 * wear.depth[row].max():.0f} um at most")
with td.plot.axes(4.2, 3.6) as (figure, axes):
    depth = 1e6 * wear.depth[row]
    drawn = td.plot.draw_field(axes, result.patch, depth, "viridis", depth.max(), depth.min())
    axes.set(xlabel="t1 / mm", ylabel="t2 / mm", title="worn off in a million cycles")
    figure.colorbar(drawn, ax=axes, label="total wear depth / µm")
figure.savefig("wear_map.png")

"""A figure for a paper

PDF and SVG are vector graphics in the same style; the curve as CSV is for a plot of your own.
"""

from pathlib import Path

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
figure = td.plot.response(result)
for ending in ("pdf", "svg", "png"):
    figure.savefig(f"response.{ending}")
print(*td.export(result, ["csv"], Path("export")), sep="\n")

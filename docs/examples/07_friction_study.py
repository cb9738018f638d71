"""What friction does

The same scene with several coefficients of friction. With 0.3 the beam swings by 32 mm, more than a tenth of
its length, which no linear model describes: `show` then warns.
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

frictions, peaks = (0.4, 0.45, 0.5, 0.55), []
for friction in frictions:
    result = td.run("beam", overrides=COARSE | {"wear": None, "contact.friction": friction})
    peaks.append(1e3 * result.summary()["amplitude"]["first"])
with td.plot.axes() as (figure, axes):
    axes.plot(frictions, peaks, "o-")
    axes.set(xlabel="coefficient of friction", ylabel="largest amplitude / mm", title="amplitude by friction")
figure.savefig("friction.png")

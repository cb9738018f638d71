"""How many harmonics

One harmonic against three: the peak of a contact that opens needs more than one.
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

with td.plot.axes() as (figure, axes):
    for kept in ([0, 1], [0, 1, 2, 3]):
        result = td.run("beam", overrides=COARSE | {"wear": None, "harmonics.kept": kept})
        axes.semilogy(result.response.frequency, 1e3 * result.response.amplitude("response"), label=str(kept))
    axes.set(xlabel="frequency / Hz", ylabel="amplitude / mm", title="harmonics that are kept")
    figure.legend(loc="outside lower center", ncols=2)
figure.savefig("harmonics.png")

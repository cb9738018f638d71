"""Three force levels on one plot

With more force more of the contact slips: the peak moves down in frequency.
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
    for force in (9, 10, 12):
        result = td.run("beam", overrides=COARSE | {"wear": None, "loads.harmonic.shake.value": f"{force} kN"})
        frf = result.response
        axes.plot(frf.frequency, 1e6 * frf.amplitude("response") / force, label=f"{force} kN")
    axes.set(xlabel="frequency / Hz", ylabel="amplitude over force / (µm/kN)", title="three force levels")
    figure.legend(loc="outside lower center", ncols=3)
figure.savefig("levels.png")

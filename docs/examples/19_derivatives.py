"""What a response depends on

Exact derivatives, and where they end. A driven mass carries a second one behind a slider. The short lines on the left
are the derivatives of its peak by friction; where the peak begins to stick they jump. Below that the peak is a corner
of the curve (middle), where slip begins: it moves along the curve of the stuck slider. With a stop for the slider the
response bends over (right): at a fold the amplitude at a given frequency has no derivative.
"""

from pathlib import Path

import numpy as np

import tribodyn as td

np.savez("masses.npz", M=np.diag([1.0, 0.566]), K=4e5 * np.array([[1.131, -0.131], [-0.131, 0.233]]))
Path("slider.toml").write_text("""
[model]
file = "masses.npz"

[contact]
dofs = [[1]]
components = ["t1"]
law = "jenkins_constant"
area = "10 mm2"
tangential_stiffness = "0.08 N/um"
normal_load = "100 N"
friction = 0.26

[loads.harmonic.shaker]
dofs = [0]
value = "10 N"

[response]
dofs = [0]
frequency = ["60 Hz", "95 Hz"]
method = "adaptive"

[harmonics]
kept = [1, 3]
transitions = "located"

[damping]
modal = "1 %"
state = "stuck"

[verdict]
enabled = false
""")

Path("stop.toml").write_text("""
[model]
file = "masses.npz"

[contact]
dofs = [[1]]
components = ["n"]
law = "unilateral"
area = "10 mm2"
normal_stiffness = "0.3 N/um"
gap = "20 um"

[loads.harmonic.shaker]
dofs = [0]
value = "2 N"

[response]
dofs = [0]
frequency = ["60 Hz", "110 Hz"]
method = "arc_length"

[harmonics]
kept = [0, 1, 2, 3]
transitions = "located"

[damping]
modal = "1 %"
state = "free"

[verdict]
enabled = false
""")

print(td.studies.derivatives("slider.toml"))
with td.plot.axes(12, 4, columns=3) as (figure, (peaks, curves, stop)):
    for friction in np.arange(0.1, 0.75, 0.08):
        changed = {"contact.friction": friction}
        rates = td.studies.derivatives("slider.toml", only=("contact.friction",), overrides=changed).derivatives
        span, amplitude = friction + np.array([-0.03, 0.03]), rates.names.index("amplitude")
        peaks.plot(span, 1e6 * (rates.values[amplitude] + rates.slopes[amplitude, 0] * (span - friction)), "k")
        peaks.plot(friction, 1e6 * rates.values[amplitude], "C3o", ms=4)
    peaks.set(xlabel="friction", ylabel="peak / \N{MICRO SIGN}m", title="a corner where the peak sticks")
    for friction, style in ((1.0, "k--"), (0.18, "C0"), (0.26, "C1"), (0.34, "C2")):
        curve = td.run("slider.toml", overrides={"contact.friction": friction}).response
        label = "stuck" if friction == 1 else f"friction {friction}"
        curves.plot(curve.frequency, 1e6 * curve.amplitude("response"), style, label=label)
    curves.set(xlabel="frequency / Hz", title="peaks that are corners")
    curves.legend()
    curve = td.run("stop.toml").response
    folds = np.flatnonzero(np.diff(np.sign(np.diff(curve.frequency)))) + 1
    stop.plot(curve.frequency, 1e6 * curve.amplitude("response"))
    stop.plot(curve.frequency[folds], 1e6 * curve.amplitude("response")[folds], "C3o")
    stop.set(xlabel="frequency / Hz", title="folds")
figure.savefig("where.png")

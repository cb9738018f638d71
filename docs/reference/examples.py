"""An example of each function of Python's reference; `docs/docstrings.py` puts it below the function's own text.

A line `# td.NAME` begins one. They follow each other in one session, which `tests/documentation/test_examples.py`
runs whole.
"""

import json
from pathlib import Path

import numpy as np

import tribodyn as td

SMALL = {
    "geometry.n_patch": 3,
    "geometry.n_length": 3,
    "geometry.n_height": 1,
    "reduction.modes": 4,
    "harmonics.kept": [0, 1],
    "response.points": 20,
    "verdict.enabled": False,
}
UNWORN = {**SMALL, "wear": None}
WORN = {**SMALL, "wear.at": "peak", "wear.motion": "balance", "wear.max_steps": 3}

# td.scene_names
print(td.scene_names())

# td.check_law
print(td.check_law("jenkins"))

# td.read_scene
scene = td.read_scene("beam", UNWORN)
print(scene.name, scene.scene.response.frequency)  # [Hz]

# td.plan
for what, cost in td.plan("beam", UNWORN).lines():
    print(what, cost)

# td.inspect
print(td.inspect("beam", overrides=UNWORN).record()["mass_kg"])

# td.build
model = td.build("beam", UNWORN)
print(model.balance.contact.gap.shape)  # a gap for each pair

# td.run
result = td.run("beam", "results/small", overrides=WORN)
print(result.summary()["peak_frequency"], result.wear.cycles[-1])

# td.load
result = td.load("results/small")
print(result.wear.depth[-1].max())  # [m]

# td.verify
light = td.run("beam", overrides={**UNWORN, "loads.harmonic.shake.value": "1 kN"})
print(td.verify(light, at=700.0).record()["largest_difference"])
print(td.verify("results/small", states=2))

# td.export
print(td.export("results/small", ["csv", "npz"], "results/small/export"))

# td.report
print(td.report(["results/small"], "results/small/report.html"))

# td.run_to_accuracy
result_of_bound, bound = td.run_to_accuracy("beam", "40 % of preload", overrides=UNWORN)
print(bound.sentence)

# td.plot.response
td.plot.response(result).savefig("response.pdf")

# td.plot.wear
td.plot.wear(result, "preload").savefig("preload.svg")

# td.plot.hysteresis
td.plot.hysteresis(result, pairs=[0, 4]).savefig("loops.png")

# td.plot.patch
td.plot.patch(result, rows=[0, -1]).savefig("patch.png")

# td.plot.status
td.plot.status(result, 4).savefig("status.png")

# td.plot.motion
td.plot.motion(td.run("beam", overrides={**WORN, "wear.motion": "machine", "wear.max_steps": 1})).savefig("motion.png")

# td.plot.write
print(td.plot.write(result, Path("results/small"), formats=("pdf",)))

# td.plot.render
print(td.plot.render(result, Path("results/small"), deformation=20.0))

# td.plot.film
print(td.plot.film(result, "results/small", "wear", formats=("gif",), images=2, dpi=40))

# td.plot.mesh_fields
grid = td.plot.mesh_fields(result)
print(grid.n_points, grid.array_names)

# td.plot.patch_fields
faces = td.plot.patch_fields(result)
print(faces.n_cells, faces.array_names)

# td.plot.axes
with td.plot.axes(4.0, 3.0) as (figure, axes):
    axes.plot(result.wear.cycles / 1e6, result.wear.preload / 1e3)
    axes.set(xlabel="cycles / million", ylabel="preload / kN")
figure.savefig("own.svg")

# td.plot.draw_field
with td.plot.axes(4.0, 3.0) as (figure, axes):
    depth = 1e6 * result.wear.depth[-1]
    td.plot.draw_field(axes, result.patch, depth, "viridis", depth.max())
figure.savefig("depth.png")

# td.plot.draw_status
with td.plot.axes(4.0, 3.0) as (figure, axes):
    td.plot.draw_status(axes, result.patch, result.wear.status[0])
figure.savefig("sticks.png")

# td.plot.length_unit
unit, scale = td.plot.length_unit(2e-5)
print(f"{scale * 2e-5:g} {unit}")

# td.plot.shades
print(td.plot.shades(3))

# td.studies.backbone
bone = td.studies.backbone("beam", 1e-6, 1e-4, points=6, overrides=UNWORN)
print(bone)

# td.studies.ring_down
decay = td.studies.ring_down("beam", 1e-7, 1e-6, points=6, periods=10, steps=64, overrides=UNWORN)
print(decay)

# td.studies.derivatives
print(td.studies.derivatives("beam", overrides=UNWORN))

# td.studies.forces
print(td.studies.forces("beam", overrides=UNWORN))

# td.studies.grid
settings = [f"{key}={json.dumps(value)}" for key, value in UNWORN.items() if value is not None] + ["wear="]
study = {"study": {"scene": "beam", "design": "grid", "set": settings}, "vary": {"contact.friction": [0.4, 0.5]}}
table = td.studies.grid(study, "results/friction", workers=1)
print(table.columns["amplitude_first"])  # [m]

# td.studies.lives
spread = {
    "study": {"scene": "beam", "design": "sobol", "runs": 8, "set": settings},
    "vary": {"contact.friction": {"distribution": "normal", "mean": 0.5, "cov": "10 %"}},
    "lives": {"number": "amplitude_first"},
}
print(td.studies.lives(spread, "results/spread", workers=1))

# td.studies.optimise
optimisation = {
    "study": {"scene": "beam", "design": "sobol", "runs": 2, "set": settings},
    "vary": {"damping.modal": {"distribution": "uniform", "low": "1 %", "high": "4 %"}},
    "optimise": {"evaluations": 3, "aims": [{"number": "amplitude_first", "want": "low"}]},
}
print(td.studies.optimise(optimisation, "results/best", workers=1))

# td.studies.identify
task = {
    "parameters": {"damping": {"keys": ["damping.modal"], "low": 0.005, "high": 0.1}},
    "measured": {"peak": {"of": "amplitude", "at": "peak", "value": "0.9 mm"}},
}
print(td.studies.identify("beam", task, overrides=UNWORN).changes)

# td.studies.compare
hertz = np.linspace(600.0, 900.0, 7)
columns = np.stack([hertz, 1e-3 / (1 + ((hertz - 800) / 50) ** 2)], 1)
np.savetxt("measured.csv", columns, delimiter=",", header="frequency_Hz,displacement_m", comments="")
print(td.studies.compare("beam", "measured.csv", overrides=UNWORN))

# td.studies.loops
turns = np.arange(1200) / 60.3
x = 25 * np.cos(2 * np.pi * turns)
falling, rising = np.clip(27 - 8 * (25 - x), -27, 27), np.clip(8 * (x + 25) - 27, -27, 27)
series = [turns / 20, x, np.where(np.sin(2 * np.pi * turns) > 0, falling, rising)]
header = "time_s,displacement_um,tangential_N"
np.savetxt("loops.csv", np.stack(series, 1), delimiter=",", header=header, comments="")
print(td.studies.loops("loops.csv", normal="30 N"))

# td.studies.worn
rows = ["name,work,volume,error", "a,100 J,5.6e5 um3,1e4 um3", "b,200 J,1.09e6 um3,1e4 um3"]
Path("tests.csv").write_text("\n".join(rows))
print(td.studies.worn("tests.csv"))

# td.wheel.build
wheel = td.wheel.build(td.read_scene("blade"))
families = {state: wheel.diagram(range(6), 2, state == "stuck") for state in ("free", "stuck")}

# td.wheel.modes
print(td.wheel.modes("blade", families=2, speeds=2))

# td.wheel.campbell
speeds, waves, critical = td.wheel.campbell(wheel, 100.0, 2, (1, 2))
print(speeds, waves["stuck"].shape, critical["stuck"])  # [Hz], (n_speed, n_order, families), [Hz]

# td.plot.nodal_diameters
td.plot.nodal_diameters(families, "blade").savefig("nodal_diameters.png")

# td.plot.safe
td.plot.safe(families, wheel.n_sectors, 110.0, 120.0, "blade").savefig("safe.png")

# td.plot.campbell
td.plot.campbell(speeds, waves, (1, 2), critical, "blade").savefig("campbell.png")

# td.wheel.mistuned
small_wheel = {"wheel.sectors": 4, "geometry.n_blades": 4, "geometry.n_along": 3, "geometry.n_up": 2}
small_wheel |= {
    "harmonics.kept": [0, 1],
    "wear": None,
    "response.frequency": ["180 Hz", "300 Hz"],
    "response.points": 20,
    "verdict.enabled": False,
}
print(td.wheel.mistuned("blade", spread=0.02, overrides=small_wheel))

# td.wheel.patterns
blades = {**small_wheel, "mistuning.frequency": "1 %", "mistuning.patterns": 2}
print(td.wheel.patterns("blade", "results/patterns", workers=1, overrides=blades))

# td.matrices.from_arrays
chain = 4e6 * (2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
chain[-1, -1] = 4e6  # the last mass is free
np.savez("chain.npz", M=0.5 * np.eye(3), K=chain)
matrices = td.matrices.from_arrays(0.5 * np.eye(3), chain)
print(*matrices.facts().lines(), sep="\n")

# td.matrices.read
print(td.matrices.read("chain.npz").stiffness.shape)

# td.matrices.reduce
stop = td.matrices.Contact(
    "stop", matrices.contact([[2]], components=("n",), area=1e-5, gap=2e-5), "unilateral", 0.0, 2e6
)
structure = td.matrices.reduce(matrices, stop, loads={"shaker": 0}, outputs={"tip": 2}, damping_ratio=0.01)
balance = structure.balance((0, 1, 2, 3), up_to=500.0, harmonic={1: {"shaker": 20.0}})
print(balance.solve(300.0).amplitude("tip"))  # [m]

# td.matrices.wear_law
law = td.matrices.wear_law("energy", coefficient=1e-14)  # [m3/J]

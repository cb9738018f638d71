"""Small reference runs of the whole product: what a fault in the sources changes in them is its effect on a result."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from proof.hard_settings.extremes_models import Body, lattice, rigid
from tests.helpers.stability_in_time import stability_in_time
from tests.helpers.structures import BLOCKS
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import verify
from tribodyn.hbm.wear.history import WearHistory, cycles_to_share
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty, WearProblem
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.workflows.errors.judgement import with_verdict
from tribodyn.workflows.errors.ladders import limit_of
from tribodyn.workflows.run import modelling, pipeline, references
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

Numbers = dict[str, np.ndarray]
NOTHING = 1e-9  # of the largest entry: a smaller difference is none

BODIES = f"""{BLOCKS}
[materials.fibre]
young = ["140 GPa", "10 GPa", "9 GPa"]
poisson = [0.3, 0.25, 0.2]
shear = ["5 GPa", "4 GPa", "3 GPa"]
density = "1600 kg/m3"
[bolts.one]
first = "upper.z_max"
second = "lower.z_min"
preload = "300 N"
stiffness = "90 N/um"
material = "steel"
[springs.side]
group = "upper.x_max"
direction = "y"
stiffness = "2 N/um"
[masses.tip]
at = "lower.x_max"
mass = "20 g"
[loads.static.weight]
direction = "-z"
acceleration = "900 m/s2"
[loads.static.turn]
direction = "z"
speed = "300 rpm"
[loads.static.warm]
temperature = "5 K"
bodies = ["lower"]
"""
COARSE = (
    "bodies.lower.n_length=3", "bodies.upper.n_length=1", "bodies.upper.n_width=2", "bodies.upper.material=fibre",
    "bodies.upper.translation=['30 mm', '3 mm', '10 mm']", "contacts.lap.friction=0.05", "harmonics=",
    "loads.harmonic.pull.value=900 N", "response.frequency=['4 kHz', '7 kHz']",
)  # fmt: skip
BEAM = (
    "geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=1", "reduction.modes=4", "response.points=20",
    "wear.max_steps=4", "harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine",
)  # fmt: skip
BLADE = (
    "geometry.n_span=3", "geometry.n_side=1", "geometry.n_root=1", "reduction.cutoff=6 kHz", "wheel.speed=6000 rpm",
)  # fmt: skip
LEAF = ("geometry.n_column=7", "geometry.pin_column=2")


def _linear(model: modelling.Model) -> Numbers:
    """Natural frequencies of the reduced part, free and stuck, and what rests on it."""
    system, _ = model.reduced.at_harmonic(model.balance.basis.harmonics[-1])
    stuck = model.balance.contact.stiffness
    return {
        "frequencies": linear_modes(model.reduced)[0],
        "stuck frequencies": linear_modes(model.reduced, stuck)[0],
        "loads": np.concatenate([np.abs(np.asarray(load)) for load in system.loads.values()] or [np.zeros(1)]),
    }


def _response(balance: HarmonicBalance, *omegas: float) -> Numbers:
    """Response, forces, energy and preload at frequencies [rad/s]."""
    result: Numbers = {}
    for number, omega in enumerate(omegas):
        solution = arc_length.solve_along_load(balance, omega)
        state = solution.state
        if not solution.converged:
            raise RuntimeError(str(solution.outcome))
        at_point = {
            "response": balance.outputs(state)[:, 1:],
            "static response": balance.outputs(state)[:, :1],
            "forces": state.cycle.force,
            "energy": balance.energy(state),
            "slope over frequency": balance.frequency_slope(state)[1],
        }
        if "n" in balance.contact.components:
            at_point["preload"] = np.array([balance.preload(state)])
        result |= {f"{name} at point {number + 1}": np.asarray(value) for name, value in at_point.items()}
    return result


def _worn(history: WearHistory) -> Numbers:
    return {
        "cycles of wear": history.cycles,
        "depth": history.depth[1:],
        "preload over wear": history.preload,
        "steps of wear": np.array([float(len(history.cycles))]),
        "error of the wear steps": history.step_error,
        "work of wear": history.work,
        "cycles to nine tenths": np.array([cycles_to_share(history.cycles, history.preload, 0.9)]),
    }


def bodies() -> Numbers:
    """Two bodies with an orthotropic material, bolt, spring, mass, pressure, weight, rotation and heat."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        model = modelling.build(scene_file.parse(BODIES, "bodies.toml", COARSE, place), Progress())
    return _linear(model) | _response(model.balance, 2 * np.pi * 5500.0)


def blade() -> Numbers:
    """A sector of a turning wheel under a travelling wave."""
    file = scene_file.read("blade", BLADE)
    model = modelling.build(file, Progress())
    area, approach = model.reduced.interface.area, references.free_deflection(model.balance)
    scale = {"depth that ends the preload": np.array([references.delta_max(file.scene, approach, area)])}
    return scale | _linear(model) | _response(model.balance, 2 * np.pi * 400.0)


def leaf_seal() -> Numbers:
    """A leaf on pins whose tip is pushed, over an eccentric shaft."""
    model = modelling.build(scene_file.read("leaf_seal", LEAF), Progress())
    return _response(model.balance, 2 * np.pi * 110.0)


def beam() -> Numbers:
    """A run from drawing to wear."""
    file = scene_file.read("beam", (*BEAM, "verdict.enabled=false"))
    result = pipeline.run(file, None, Progress())
    return {
        name: np.array([float(number)])
        for name, value in result.summary().items()
        for number in (value if isinstance(value, list | tuple) else [value])
        if isinstance(number, float) and "second" not in name
    }


def stated() -> Numbers:
    """Errors that a run states of itself."""
    result = pipeline.run(scene_file.read("beam", BEAM), None, Progress(), judge=with_verdict)
    said = result.verdict
    assert said is not None
    outcome = {f"stated error of {name}": item.error for name, item in said.statements.items()}
    parts = {f"change of {item.quantity} by {item.refinement}": item.relative for item in said.changes}
    values = np.array([_response_size(lattice(2, 2), top) for top in (1, 3, 7)])
    limit = {"limit over harmonics": np.array([limit_of([1, 2, 4], list(values)).value])}
    return limit | {name: np.array([error]) for name, error in (outcome | parts).items() if error is not None}


def _response_size(body: Body, top: int) -> float:
    balance = body.balance(replace(body.ordinary, harmonics=tuple(range(top + 1))))
    state = arc_length.solve_along_load(balance, body.ordinary.omega).state
    return float(np.linalg.norm(balance.outputs(state)[:, 1:]))


def pairs() -> Numbers:
    """Pairs that stick, slip and lift, with located and with sampled transitions, over gaps and on moving ground."""
    body = lattice(2, 2)
    result: Numbers = {}
    for transitions in ("located", "sampled"):
        for gap in (0.0, -2e-6):
            setting = replace(body.ordinary, harmonics=(0, 1, 2, 3), transitions=transitions, gap=gap)
            at_gap = _response(body.balance(setting), setting.omega)
            result |= {f"{name}, {transitions}, gap {gap:g} m": value for name, value in at_gap.items()}
    plain = body.balance(replace(body.ordinary, harmonics=(0, 1)))
    base = np.zeros((plain.compliance.n_contact, 3))
    base[::3, 1] = 2e-6
    excitation = replace(plain.excitation, base=base)
    model = body.model.with_damping(lambda system, _: modal_damping(system, 0.01))
    shifted = HarmonicBalance.of(model, plain.contact.joints[0], plain.basis, excitation, body.ordinary.omega)
    return result | {f"{name}, moving ground": v for name, v in _response(shifted, body.ordinary.omega).items()}


def peak() -> Numbers:
    """A peak of a mass that slips, and one of a mass that lifts."""
    body = rigid(1)
    balance = body.balance(body.ordinary)
    at = AtPeak("mass", 800.0, 1700.0).solve(balance)
    point = {"peak frequency": np.array([at.state.omega]), "peak amplitude": np.array([at.amplitude])}
    system = SecondOrderSystem(
        np.eye(1), np.array([[1e4]]), np.array([[2.0]]), {"press": np.ones(1)}, {"mass": np.ones(1)}
    )
    lifting = replace(rigid(1).model, system=system, interface=_normal())
    joint = Joint("contact", "unilateral", ContactParameters.of(("n",), np.array([[4e4]])))
    excitation = Excitation.of({"press": 3.0}, {1: {"press": 3.0}})
    bent = HarmonicBalance.of(lifting, joint, HarmonicBasis((0, 1, 2), 128), excitation, 300.0)
    solved = newton.solve_from_rest(bent, 120.0).state
    in_time = verify(bent, solved, Options(steps=128, max_periods=600)).motion
    return point | _response(bent, 120.0) | {"lifting in time": np.array([np.ptp(in_time.outputs)])}


def _normal() -> Any:
    return replace(rigid(1).model.interface, components=("n",), B=np.ones((1, 1)))


def wear() -> Numbers:
    """Wear by both rules, and by both laws."""
    body = rigid(2)
    result: Numbers = {}
    balance = body.balance(body.ordinary)
    delta = float(references.free_deflection(balance).max())
    for law, coefficient in (("energy", 2e-15), ("archard", 1e-15)):
        duty = Duty(AtFrequency("mass", body.ordinary.omega))
        wears = JointWear.of(law, coefficient=coefficient)
        problem = WearProblem(balance, (duty,), wears, body.model.interface.area, lost_below=0.5)
        tolerance = Tolerance(0.05, delta)
        histories = {
            "thesis": evolve(thesis.Rule(problem, 0.05 * delta), 6),
            "error-controlled": evolve(error_controlled.Rule(problem, tolerance), 6),
        }
        for rule, history in histories.items():
            result |= {f"{name}, {law}, {rule}": value for name, value in _worn(history).items()}
    return result


def in_time() -> Numbers:
    """Direct time integration, what it says of its steps, and Floquet exponents."""
    result: Numbers = {}
    for body in (rigid(1), lattice(2, 1)):
        balance = body.balance(replace(body.ordinary, damping=0.05))
        state = arc_length.solve_along_load(balance, body.ordinary.omega).state
        verification = verify(balance, state, Options(steps=64, max_periods=200))
        result |= {
            f"motion in time, {body.name}": verification.motion.outputs,
            f"energy in time, {body.name}": verification.motion.energy,
            f"error of the time steps, {body.name}": np.array([verification.step_error]),
        }
    stuck = rigid(1).balance(replace(rigid(1).ordinary, force=5.0, damping=0.05))
    still = newton.solve_from_rest(stuck, 1100.0).state
    exponents = stability_in_time(stuck, still).exponents
    return result | {"Floquet exponents": np.array([exponents.real.max(), np.abs(exponents.imag).max()])}


RUNS: Mapping[str, Callable[[], Numbers]] = {
    scene_run.__name__: scene_run for scene_run in (bodies, blade, leaf_seal, beam, pairs, peak, wear, in_time, stated)
}


def numbers(names: tuple[str, ...]) -> Iterator[tuple[str, Numbers | None]]:
    """Each run with its numbers, None where it fails, as it may do with a fault in the sources."""
    for name in names:
        result = None
        with suppress(Exception):
            result = RUNS[name]()
        yield name, result


def change(before: Numbers, after: Numbers) -> tuple[float, str]:
    """Largest difference of a quantity, over its own largest entry before, and which one it is."""
    worst = (0.0, "")
    for name, a in before.items():
        b = after.get(name)
        size = float(np.abs(a).max(initial=0.0))
        if b is None or a.shape != b.shape or not np.all(np.isfinite(b) == np.isfinite(a)):
            return (float("inf"), name)
        off = float(np.nanmax(np.abs(b - a), initial=0.0)) / (size or 1.0)
        if off > max(worst[0], NOTHING):
            worst = (off, name)
    return worst

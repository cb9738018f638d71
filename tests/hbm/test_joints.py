"""Several joints in one balance: a face cut in two is the face, two laws are two models, what a joint does not see."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla

from tests.helpers.pressed_body import N_PAIR, balance_of, pressed_body, wear_problem
from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import Duty
from tribodyn.reduction.model import ReducedModel

OMEGA = 420.0
TIGHT = NewtonOptions(tolerance=1e-13)
ALL = ("t1", "t2", "n")


def split(balance: HarmonicBalance, parts: list[np.ndarray]) -> HarmonicBalance:
    """The same balance with its one joint cut into several."""
    full = balance.contact.joints[0]
    joints = [Joint(f"part {i}", full.law, full.parameters.subset(p), p) for i, p in enumerate(parts)]
    return HarmonicBalance.of(balance.model, joints, balance.basis, balance.excitation, balance.omega_max)


@pytest.mark.parametrize("located", [False, True])
def test_a_face_split_into_joints_is_the_face(located: bool) -> None:
    full = balance_of(pressed_body()).with_samples(64, located)
    parts = split(full, [np.array([2]), np.array([3, 0, 1])])  # the order of a joint's pairs is its own
    item, large = (newton.solve_from_rest(b, OMEGA, TIGHT) for b in (full, parts))
    assert item.converged
    assert large.converged
    assert set(np.unique(item.state.cycle.status)) - {1}  # not all stick all the time
    np.testing.assert_allclose(large.state.x, item.state.x, atol=1e-12 * np.abs(item.state.x).max())
    force = item.state.cycle.force
    np.testing.assert_allclose(large.state.cycle.force, force, atol=1e-12 * np.abs(force).max())
    jacobian = item.state.cycle.jacobian
    np.testing.assert_allclose(
        parts.evaluate(OMEGA, item.state.x).cycle.jacobian, jacobian, atol=1e-12 * np.abs(jacobian).max()
    )
    np.testing.assert_array_equal(large.state.cycle.status, item.state.cycle.status)
    np.testing.assert_allclose(parts.energy(large.state), full.energy(item.state), rtol=1e-10, atol=1e-15)
    of_whole, of_parts = full.history(item.state), parts.history(large.state)
    for a, b in zip(of_whole, of_parts, strict=True):
        np.testing.assert_allclose(b, a, atol=1e-11 * np.abs(a).max())
    preload = parts.preload_by_joint(large.state)
    assert sum(preload.values()) == pytest.approx(full.preload(item.state), rel=1e-12)
    energy = parts.contact.by_joint(parts.energy(large.state))
    assert list(energy) == ["part 0", "part 1"]
    assert [len(e) for e in energy.values()] == [1, 3]


def test_stability_of_a_split_face_is_that_of_the_face() -> None:
    full = balance_of(pressed_body(), (0, 1, 2, 3), 20.0)
    parts = split(full, [np.arange(2), np.arange(2, N_PAIR)])
    states = [newton.solve_from_rest(b, OMEGA, TIGHT).state for b in (full, parts)]
    first, second = (exponents.stability(b, s) for b, s in zip((full, parts), states, strict=True))
    np.testing.assert_allclose(np.sort(second.exponents.real), np.sort(first.exponents.real), atol=1e-7 * OMEGA)


def body(seed: int, stiff: float) -> SecondOrderSystem:
    """A body whose first six coordinates are two pairs of t1, t2, n."""
    rng = np.random.default_rng(seed)
    n = 18
    factor = rng.normal(size=(n, n))
    stiffness = stiff * (factor @ factor.T / n + 0.05 * np.eye(n))
    mass = np.eye(n)
    lam, phi = sla.eigh(stiffness, mass)
    damping = phi @ np.diag(2 * 0.02 * np.sqrt(lam)) @ phi.T
    press, shake = np.zeros(n), np.zeros(n)
    press[[2, 5]], shake[[0, 4, 8]] = 0.5, 1.0
    return SecondOrderSystem(mass, stiffness, damping, {"press": press, "shake": shake}, {"tip": shake})


def two_bodies() -> tuple[ReducedModel, ReducedModel, ReducedModel]:
    """Two bodies that know nothing of each other, alone and as one model with one contact map."""
    first, second = body(1, 1e6), body(2, 3e6)
    n = len(first.mass)

    def block(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.asarray(sla.block_diag(a, b))

    loads = {f"{name}1": np.append(v, np.zeros(n)) for name, v in first.loads.items()}
    loads |= {f"{name}2": np.append(np.zeros(n), v) for name, v in second.loads.items()}
    outputs = {"tip1": loads["shake1"], "tip2": loads["shake2"]}
    system = SecondOrderSystem(
        block(first.mass, second.mass), block(first.stiffness, second.stiffness),
        block(first.damping, second.damping), loads, outputs,
    )  # fmt: skip
    item = np.eye(6, n)
    return (
        ReducedModel(first, interface(item, ALL)),
        ReducedModel(second, interface(item, ALL)),
        ReducedModel(system, interface(block(item, item), ALL)),
    )


def test_two_laws_in_one_balance_are_two_models_with_one_law_each() -> None:
    remaining, right, two_results = two_bodies()
    k = np.tile([2e5, 2e5, 3e5], (2, 1))
    jenkins = Joint("left", "jenkins", ContactParameters.of(ALL, k, friction=0.4), np.arange(2))
    planar = Joint("right", "coulomb_planar", ContactParameters.of(ALL, 2 * k, friction=0.2), np.arange(2, 4))
    basis = HarmonicBasis((0, 1, 2, 3), 128)

    def solved(model, joints, numbers):
        names = [""] if len(numbers) == 1 else [str(i) for i in numbers]
        static = {f"press{i}": 60.0 for i in names}
        balance = HarmonicBalance.of(
            model, joints, basis, Excitation.of(static, {1: {f"shake{i}": 120.0 for i in names}}), 900.0
        )
        solution = newton.solve_from_rest(balance, 600.0, TIGHT)
        assert solution.converged, solution.outcome
        return balance, solution

    full, together = solved(two_results, [jenkins, planar], (1, 2))
    states = full.contact.by_joint(together.state.x)
    slips = []
    for model, joint, name in ((remaining, jenkins, "left"), (right, planar, "right")):
        _, single = solved(model, replace(joint, pairs=None), (1,))
        np.testing.assert_allclose(states[name], single.state.x, atol=1e-11 * np.abs(single.state.x).max())
        np.testing.assert_array_equal(
            full.contact.by_joint(together.state.cycle.status)[name], single.state.cycle.status
        )
        slips.append(bool(np.any(single.state.cycle.status & 2)))
    assert all(slips)


def test_a_joint_has_no_spring_and_no_force_where_it_does_not_see() -> None:
    remaining, _, two_results = two_bodies()
    k = np.tile([2e5, 2e5, 3e5], (2, 1))
    normal = Joint("pad", "unilateral", ContactParameters.of(("n",), k[:, 2:]), slice(0, 2))
    other = Joint("wedge", "jenkins", ContactParameters.of(("t2", "n"), k[:, 1:], friction=0.3), slice(2, 4))
    basis = HarmonicBasis((0, 1, 2), 64, "located")
    excitation = Excitation.of({"press1": 60.0, "press2": 40.0}, {1: {"shake1": 90.0, "shake2": 90.0}})
    balance = HarmonicBalance.of(two_results, [normal, other], basis, excitation, 900.0)
    np.testing.assert_array_equal(balance.contact.stiffness[:2, :2], 0.0)
    np.testing.assert_array_equal(balance.contact.stiffness[2:, 0], 0.0)
    assert balance.memory.shape == (4, 1)  # the pad has no memory, the wedge one slider a pair
    solution = newton.solve_from_rest(balance, 600.0, TIGHT)
    assert solution.converged
    force = solution.state.cycle.force
    np.testing.assert_array_equal(force[:2, :2], 0.0)
    np.testing.assert_array_equal(force[2:, 0], 0.0)
    assert np.all(np.abs(force[:, 2, 0]) > 0)
    # the pad alone, on a model that has nothing but its normal direction
    system = remaining.system
    observed = ReducedModel(system, interface(np.eye(6, len(system.mass))[[2, 5]], ("n",)))
    single = HarmonicBalance.of(
        observed, replace(normal, pairs=None), basis, Excitation.of({"press": 60.0}, {1: {"shake": 90.0}}), 900.0
    )
    equal = newton.solve_from_rest(single, 600.0, TIGHT)
    np.testing.assert_allclose(solution.state.x[:2, 2:], equal.state.x, atol=1e-11 * np.abs(equal.state.x).max())


def test_joints_share_out_the_pairs() -> None:
    balance = balance_of(pressed_body())
    full = balance.contact.joints[0]

    def made(*joints: Joint) -> None:
        HarmonicBalance.of(balance.model, joints, balance.basis, balance.excitation, balance.omega_max)

    def part(name: str, *pairs: int) -> Joint:
        return Joint(name, "jenkins", full.parameters.subset(np.array(pairs)), np.array(pairs))

    with pytest.raises(ValueError, match="pair 3 of the contact belongs to 0 joints"):
        made(part("a", 0, 1, 2))
    with pytest.raises(ValueError, match="pair 1 of the contact belongs to 2 joints"):
        made(part("a", 0, 1), part("b", 1, 2, 3))
    with pytest.raises(ValueError, match="different names, got a, a"):
        made(part("a", 0, 1), part("a", 2, 3))
    with pytest.raises(ValueError, match="joint 'a' has pairs beyond the 4"):
        made(replace(part("a", 0, 1), pairs=np.array([0, 9])), part("b", 2, 3))
    with pytest.raises(ValueError, match="covers 3 pairs and has parameters of 2"):
        made(replace(part("a", 0, 1), pairs=slice(0, 3)), part("b", 3))
    with pytest.raises(ValueError, match="at least one joint"):
        made()
    with pytest.raises(ValueError, match="'unilateral' has components"):
        made(replace(full, law="unilateral"))


@pytest.mark.parametrize("rule", ["thesis", "error controlled"])
def test_joints_wear_by_their_own_laws(rule: str) -> None:
    full = wear_problem()
    cut = split(full.balance, [np.arange(2), np.arange(2, N_PAIR)])

    def worn(problem: object) -> np.ndarray:
        if rule == "thesis":
            return evolve(thesis.Rule(problem, 5e-7), max_steps=6).depth[-1]
        return evolve(error_controlled.Rule(problem, Tolerance(0.05, 2e-4)), max_steps=4).depth[-1]

    item = worn(full)
    assert np.all(item > 0)
    equal = {"part 0": JointWear.of("energy", coefficient=1e-9), "part 1": JointWear.of("energy", coefficient=1e-9)}
    np.testing.assert_allclose(worn(replace(full, balance=cut, wear=equal)), item, rtol=1e-7)
    still = worn(replace(full, balance=cut, wear={"part 1": JointWear.of("energy", coefficient=1e-9)}))
    np.testing.assert_array_equal(still[:2], 0.0)
    assert np.all(still[2:] > 0)
    archard = JointWear.of("archard", coefficient=4e-10)
    law_and_law = {"part 0": archard, "part 1": JointWear.of("energy", coefficient=1e-9)}
    other = worn(replace(full, balance=cut, wear=law_and_law))
    np.testing.assert_allclose(other[2:], item[2:], rtol=0.05)
    # k = mu alpha is the energy law along a line; in the plane a path is up to sqrt(2) shorter than its two parts
    assert np.all((other[:2] > 0.6 * item[:2]) & (other[:2] < 1.03 * item[:2]))
    with pytest.raises(ValueError, match="no joint 'part 2': there are part 0, part 1"):
        worn(replace(full, balance=cut, wear={"part 2": JointWear.of("energy", coefficient=1e-9)}))


def test_only_the_preload_of_wearing_joints_counts() -> None:
    full = wear_problem(lost_below=0.5)
    cut = split(full.balance, [np.arange(2), np.arange(2, N_PAIR)])
    problem = replace(
        full, balance=cut, mission=(Duty(AtFrequency("tip", OMEGA)),),
        wear={"part 1": JointWear.of("energy", coefficient=1e-9)},
    )  # fmt: skip
    history = evolve(thesis.Rule(problem, 2e-5), max_steps=40)
    state = newton.solve_from_rest(cut, OMEGA).state
    assert history.preload[0] == pytest.approx(cut.preload_by_joint(state)["part 1"], rel=1e-6)
    assert str(history.end).startswith("preload fell below 0.5")

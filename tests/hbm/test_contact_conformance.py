"""What every contact law must obey, run over every law file and every set of its components.

The laws of the package are found by their names, those of tests/hbm/laws by their files; see contact_draws."""

import numpy as np
import pytest
import scipy.linalg as sla

import tribodyn as td
from tests.helpers.contact_draws import (
    CLOSED_FORMS,
    EVENT_BASED,
    HARMONICS,
    LAWS,
    TEST_LAWS,
    law_id,
    slip_limit,
    tangential,
    unit_scale,
)
from tests.helpers.verification_models import interface, modal_damping
from tribodyn import declarations
from tribodyn.declarations import Role
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.compiled_law import pointer
from tribodyn.hbm.contact.contact_law import SLIPS, STICKS, ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.law_check import draw, errors_of_cycles, errors_of_steps, law_numbers
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.recovery import coordinates
from tribodyn.reduction.model import ReducedModel

EVERY_LAW = pytest.mark.parametrize(("name", "components"), LAWS, ids=law_id)
FRICTION = pytest.mark.parametrize(
    ("name", "components"), [(name, c) for name, c in LAWS if contact_law.load(name).n_state(c) > 0], ids=law_id
)
FAST = [(name, components) for name, components in LAWS if hasattr(contact_law.load(name), "sampled_cycle")]
EVERY_FAST_LAW = pytest.mark.parametrize(("name", "components"), FAST, ids=law_id)


def transitions_of(name, components):
    """The ways in which a law offers its cycle: basis.transitions values."""
    return ("sampled", "located") if (name, components) in EVENT_BASED else ("sampled",)


def is_exact(name, components, way):
    """Whether transitions are roots in closed form; those of other laws are searched for, to some 1e-8 rad."""
    return way == "located" and (name, components) in CLOSED_FORMS


def depends_on_path(name, components):
    """Whether a pair that comes to stick keeps something of its path, as a step of integration does."""
    return contact_law.load(name).n_state(components) > 0 and (name, components) not in EVENT_BASED


def test_the_laws_of_the_tests_are_among_them():
    """One of them has its step alone, and a limit in newtons under a name of its own."""
    law = str(TEST_LAWS / "slip_force.py")
    assert (law, ("t1", "t2")) in EVENT_BASED
    assert [(number.name, number.role) for number in contact_law.declared(law)] == [("strength", "slip_force")]
    assert not {"sampled_cycle", "event_based_cycle"} & set(vars(contact_law.load(law)))


@EVERY_LAW
def test_the_checks_of_a_users_law_pass_closely(name, components):
    """Derivatives of a step equal differences of order six."""
    errors = errors_of_steps(name, components)
    assert errors == {"derivatives of a step": pytest.approx(0.0, abs=4e-11), **dict.fromkeys(list(errors)[1:], 0.0)}
    for way in transitions_of(name, components):
        errors = errors_of_cycles(name, components, way)
        assert errors["derivatives of a cycle"] < 1e-6
        assert all(errors[key] < 1e-11 for key in list(errors)[1:])


@pytest.mark.parametrize(
    ("right", "wrong", "errors"),
    [
        ("k * (x[c] - s[c])", "k * (s[c] - x[c])", {"derivatives of a step", "no repeating cycle"}),
        ("dfs[c, c] = -k", "dfs[c, c] = k", {"derivatives of a step", "derivatives of a cycle"}),
        ("bits |= SLIPS", "bits |= 8", {"no status or force"}),
        ("s[c] = x[c] - f[c] / k", "s[c] = x[c]", {"no repeating cycle"}),
    ],
)
def test_faults_of_a_law_are_named(right, wrong, errors, tmp_path):
    (tmp_path / "law.py").write_text((TEST_LAWS / "slip_force.py").read_text().replace(right, wrong))
    verdict = td.check_law(tmp_path / "law.py")
    assert verdict.startswith("law: not a contact law yet")
    assert errors <= {line[4:29].strip() for line in verdict.splitlines() if line.startswith("BAD")}


@EVERY_LAW
@pytest.mark.parametrize("harmonics", HARMONICS, ids=str)
def test_jacobian_of_the_cycle_equals_differences(name, components, harmonics):
    law = contact_law.load(name)
    for way in transitions_of(name, components):
        basis = HarmonicBasis(harmonics, 64, way)
        x, parameters, memory = draw(name, components, basis, 80, seed=3)
        direction = np.random.default_rng(4).normal(size=x.shape) * np.abs(x).max(axis=(1, 2), keepdims=True)

        def force(e, x=x, parameters=parameters, basis=basis, memory=memory, direction=direction):
            return aft.cycle(law, x + e * direction, parameters, basis, memory, jacobian=False).force

        coarse, fine = ((force(e) - force(-e)) / (2 * e) for e in (2e-6, 1e-6))
        slope = aft.cycle(law, x, parameters, basis, memory).jacobian
        exact = (slope @ direction.reshape(80, -1, 1)).reshape(x.shape)
        scale = 1e-30 + np.abs(exact).max(axis=(1, 2))
        smooth = np.abs(coarse - fine).max(axis=(1, 2)) < 1e-5 * scale  # no transition passes a sample within the step
        error = np.abs(fine - exact).max(axis=(1, 2)) / scale
        assert smooth.mean() > 0.9
        assert np.quantile(error[smooth], 0.95) < 1e-6
        assert error[smooth].max() < 1e-4


@EVERY_FAST_LAW
def test_fast_cycle_equals_the_marched_one_to_rounding(name, components):
    law = contact_law.load(name)
    for harmonics in HARMONICS:
        for n_samples in (15, 128):
            basis = HarmonicBasis(harmonics, n_samples)
            x, parameters, memory = draw(name, components, basis, 100, seed=5)
            fast = law.sampled_cycle(x, parameters, memory, basis)
            slow = aft.march(law, x, parameters, memory, basis)
            np.testing.assert_allclose(fast.force, slow.force, atol=1e-13)
            np.testing.assert_allclose(fast.jacobian, slow.jacobian, atol=1e-13)
            np.testing.assert_array_equal(fast.status, slow.status)
            assert law.sampled_cycle(x, parameters, memory, basis, jacobian=False).jacobian is None


@FRICTION
def test_friction_stays_within_its_limit_and_the_normal_force_pushes(name, components):
    law = contact_law.load(name)
    basis = HarmonicBasis((0, 1, 2, 3), 64)
    x, parameters, memory = draw(name, components, basis, 200, seed=6)
    _, force = aft.history(law, x, parameters, basis, memory)
    normal = np.zeros_like(force[:, 0])
    if "n" in components:
        normal = force[:, -1]
    elif load := declarations.name_of(Role.NORMAL_LOAD, contact_law.declared(name)):
        normal = np.broadcast_to(parameters.numbers[load][:, None], normal.shape)
    assert normal.min() >= 0.0
    t = force[:, tangential(components)]
    size = np.linalg.norm(t, axis=1) if depends_on_path(name, components) else np.abs(t).max(axis=1)
    assert np.all(size <= slip_limit(name, parameters, normal) * (1 + 1e-12) + 1e-14)


@EVERY_LAW
def test_stick_limit_is_the_linear_spring(name, components):
    law = contact_law.load(name)
    for way in transitions_of(name, components):
        basis = HarmonicBasis((0, 1, 2, 3), 64, way)
        x, drawn, _ = draw(name, components, basis, 50, seed=8)
        if "n" in components:
            x[:, -1, 0] = np.abs(x[:, -1, 1:]).sum(axis=1) + 1
        numbers = law_numbers(name, friction=1e6, normal_load=1.0, slip_force=1e6)
        parameters = ContactParameters.of(components, drawn.stiffness, **numbers)
        cycle = aft.cycle(law, x, parameters, basis)
        linear = drawn.stiffness[:, :, None] * x
        stiffness = np.stack([np.diag(np.repeat(k, basis.n_coeff)) for k in drawn.stiffness])
        tolerance = 0.0 if is_exact(name, components, way) else 1e-14
        np.testing.assert_allclose(cycle.force, linear, rtol=0, atol=tolerance * np.abs(linear).max())
        np.testing.assert_allclose(cycle.jacobian, stiffness, rtol=0, atol=tolerance * 2)
        assert np.all(cycle.status == STICKS)


@FRICTION
def test_full_slip_limit_of_energy(name, components):
    """One direction, constant limit L: E = 4 L (A - L / k_t)."""
    law = contact_law.load(name)
    amplitude, mu, load, kt = 10.0, 0.3, 2.0, 5.0
    for way in transitions_of(name, components):
        basis = HarmonicBasis((0, 1), 4096, way)
        x = np.zeros((1, len(components), basis.n_coeff))
        x[0, 0, 1] = amplitude
        if "n" in components:
            x[0, -1, 0] = load
        k = np.full((1, len(components)), kt)
        k[0, -1] = 1.0 if "n" in components else kt
        numbers = law_numbers(name, friction=mu, normal_load=load, slip_force=mu * load)
        parameters = ContactParameters.of(components, k, **numbers)
        cycle = aft.cycle(law, x, parameters, basis)
        energy = basis.work_per_cycle(cycle.force, x)[0, 0]
        exact = 4 * mu * load * (amplitude - mu * load / kt)
        assert energy == pytest.approx(exact, rel=1e-12 if is_exact(name, components, way) else 2e-6)


@EVERY_LAW
def test_time_origin_does_not_matter(name, components):
    """Shifted motion, shifted force. Planar friction that comes to stick depends on its path: only slipping pairs."""
    law = contact_law.load(name)
    for way in transitions_of(name, components):
        basis = HarmonicBasis((0, 1, 2, 3), 60, way)
        x, parameters, _ = draw(name, components, basis, 100, seed=9)
        angle = 2 * np.pi * 7 / 60 if way == "sampled" else 1.234
        first = aft.cycle(law, x, parameters, basis)
        second = aft.cycle(law, basis.shift(x, angle), parameters, basis)
        keep = (first.status & SLIPS) > 0 if depends_on_path(name, components) else np.ones(100, bool)
        assert keep.sum() > 30
        scale = np.abs(first.force).max()
        error = np.abs(second.force - basis.shift(first.force, angle)).max(axis=(1, 2))
        assert error[keep].max() < 1e-11 * scale
        equal = first.status[keep] == second.status[keep]  # a pair on the rim of sticking may touch slip by rounding
        assert equal.mean() > 0.9


@EVERY_LAW
def test_mirror_image_of_the_plane(name, components):
    """Each tangential direction mirrored with its memory mirrors its force alone."""
    law = contact_law.load(name)
    for way in transitions_of(name, components):
        basis = HarmonicBasis((0, 1, 2, 3), 64, way)
        x, parameters, memory = draw(name, components, basis, 100, seed=10)
        first = aft.cycle(law, x, parameters, basis, memory)
        for c in tangential(components):
            flip = np.ones(len(components))
            flip[c] = -1.0
            mirrored = memory * np.resize(
                flip[: min(memory.shape[1], len(tangential(components)) or 1)], memory.shape[1]
            )
            second = aft.cycle(law, x * flip[:, None], parameters, basis, mirrored)
            np.testing.assert_allclose(second.force, first.force * flip[:, None], atol=1e-12)


@EVERY_LAW
def test_action_is_reaction(name, components):
    """What two bodies, joined by their contact alone, lack to be in balance is the contact force, and minus it."""
    n_pair, n_comp = 4, len(components)
    n_contact, n_body = n_pair * n_comp, n_pair * n_comp + 3
    rng = np.random.default_rng(12)
    a = rng.normal(size=(2, n_body, n_body))
    stiffness = sla.block_diag(*(m @ m.T / n_body + 0.2 * np.eye(n_body) for m in a))
    mass = np.eye(2 * n_body)
    loads = {"press": np.zeros(2 * n_body), "shake": rng.normal(size=2 * n_body)}
    loads["press"][n_comp - 1 : n_contact : n_comp], loads["press"][n_body + n_comp - 1 :: n_comp] = 1.0, -1.0
    damping = modal_damping(mass, stiffness, 0.05)
    touching = np.eye(n_contact, n_body)
    system = SecondOrderSystem(mass, stiffness, damping, loads, {"first": np.eye(2 * n_body)[-1]})
    model = ReducedModel(system, interface(np.hstack([touching, -touching]), components))
    parameters = ContactParameters.of(
        components,
        np.full((n_pair, n_comp), 1.5),
        **law_numbers(name, friction=0.3, normal_load=1.0, slip_force=0.3, free=0.1),
    )
    basis = HarmonicBasis((0, 1, 2, 3), 64)
    excitation = Excitation.of({"press": 0.5}, {1: {"shake": 1.0}})
    balance = HarmonicBalance.of(model, Joint("contact", name, parameters), basis, excitation, 2.0)
    solution = newton.solve_from_rest(balance, 0.8)
    assert solution.converged
    state = solution.state
    flat = state.cycle.force.reshape(n_contact, -1)
    force = basis.to_complex(flat)
    size = np.abs(force).max()
    assert size > 0.05
    shifted = coordinates(balance, state.flat, flat, 0.8)
    for at, (h, q) in enumerate(zip(basis.harmonics, shifted, strict=True)):
        lacking = (stiffness + 0.8j * h * damping - (0.8 * h) ** 2 * mass) @ q
        for name_of, value in (("press", 0.5 * (h == 0)), ("shake", 1.0 * (h == 1))):
            lacking = lacking - value * loads[name_of]
        first, second = np.split(-lacking, 2)
        np.testing.assert_allclose(first[:n_contact], force[:, at], atol=1e-6 * size)
        np.testing.assert_allclose(second[:n_contact], -force[:, at], atol=1e-6 * size)
        assert np.abs(np.concatenate([first[n_contact:], second[n_contact:]])).max() < 1e-6 * size


@EVERY_LAW
@pytest.mark.parametrize("length", [1e-9, 1e9])
@pytest.mark.parametrize("unit_force", [1e-9, 1e9])
def test_units_of_length_and_force_do_not_matter(name, components, length, unit_force):
    law = contact_law.load(name)
    for way in transitions_of(name, components):
        basis = HarmonicBasis((0, 1, 2, 3), 64, way)
        x, p, memory = draw(name, components, basis, 100, seed=11)
        units = {number.name: unit_scale(number.unit, length, unit_force) for number in contact_law.declared(name)}
        scaled = ContactParameters.of(
            components, p.stiffness * unit_force / length, gap=p.gap * length,
            **{key: value * units[key] for key, value in p.numbers.items()},
        )  # fmt: skip
        first = aft.cycle(law, x, p, basis, memory)
        second = aft.cycle(law, x * length, scaled, basis, memory * length)
        np.testing.assert_allclose(second.force / unit_force, first.force, atol=1e-11)
        error = np.abs(second.jacobian * length / unit_force - first.jacobian).max(axis=(1, 2))
        searched = way == "located" and not is_exact(name, components, way)
        assert np.quantile(error, 0.97) < (1e-6 if searched else 1e-9)
        assert (first.status == second.status).mean() > 0.9  # pairs on the rim of sticking


@EVERY_LAW
def test_memory_repeats(name, components):
    """March on from the settled memory: the same cycle again."""
    law = contact_law.load(name)
    basis = HarmonicBasis((0, 1, 2, 3), 64)
    x, parameters, memory = draw(name, components, basis, 100, seed=12)
    samples, phi, none = basis.to_time(x), np.zeros((64, 0)), np.zeros((memory.shape[1], 0))

    def settle(start):
        other = start.copy()
        for u, p, s in zip(samples, parameters.packed(), other, strict=True):
            assert aft.settle(pointer(law.step), u, p, phi, s, none) >= 0
        return other

    stationary = settle(memory)
    np.testing.assert_allclose(settle(stationary), stationary, atol=1e-12)
    first = aft.cycle(law, x, parameters, basis, memory)
    second = aft.cycle(law, x, parameters, basis, stationary)
    np.testing.assert_allclose(second.force, first.force, atol=1e-11)


@EVERY_LAW
def test_extreme_parameters_give_finite_forces(name, components):
    law = contact_law.load(name)
    for way in transitions_of(name, components):
        basis = HarmonicBasis((0, 1, 2, 3), 64, way)
        x, p, memory = draw(name, components, basis, 60, seed=13)
        for k, mu in ((1e-15, 0.0), (1e15, 10.0), (0.0, 0.5), (1e3, 0.0), (1e15, 1e-12)):
            stiffness = np.full_like(p.stiffness, k)
            numbers = law_numbers(name, friction=mu, normal_load=1e6, slip_force=1e6 * mu)
            extreme = ContactParameters.of(components, stiffness, gap=p.gap, **numbers)
            for motion in (x, 0 * x, 1e-12 * x, 1e6 * x):
                cycle = aft.cycle(law, motion, extreme, basis, memory)
                assert np.isfinite(cycle.force).all()
                assert np.isfinite(cycle.jacobian).all()


def test_law_without_located_transitions_refuses():
    basis = HarmonicBasis((0, 1), 16, "located")
    refused = [(name, components) for name, components in LAWS if (name, components) not in EVENT_BASED]
    assert refused
    for name, components in refused:
        law = contact_law.load(name)
        x, parameters, memory = draw(name, components, basis, 2, seed=0)
        with pytest.raises(ValueError, match=f"'{name}' does not locate its transitions: take transitions = 'sampled'"):
            aft.cycle(law, x, parameters, basis, memory)
    with pytest.raises(ValueError, match="transitions must be"):
        HarmonicBasis((0, 1), 16, "exact")


def test_names_and_components():
    assert {"jenkins", "jenkins_constant", "coulomb_planar", "unilateral", "cubic_spring"} <= set(contact_law.names())
    with pytest.raises(ValueError, match="no contact law 'glue': there are"):
        contact_law.load("glue")
    with pytest.raises(ValueError, match="'unilateral' has components \\(n\\), not"):
        contact_law.complete("unilateral", ContactParameters.of(("t1", "n"), [[1.0, 1.0]]))
    assert contact_law.load("unilateral").n_state(("n",)) == 0

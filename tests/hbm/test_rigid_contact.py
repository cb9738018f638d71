"""Contact without springs in time, beside closed forms and results of NLstep.

nlstep.npz holds matrices of examples 02 and 04 of NLstep (Krack and Gross, University of Stuttgart, 2025, licence
GPL-3.0-or-later; Monjaraz-Tec, Gross and Krack 2022); the numbers below are its results with 2048 steps a period."""

from pathlib import Path

import numpy as np
import pytest

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.time.stepper import Options, TimeStepper
from tribodyn.hbm.time.time_integration import PeriodicMotion, integrate
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal

DATA = np.load(Path(__file__).with_name("nlstep.npz"))


def motion_of(balance: HarmonicBalance, omega: float, steps: int) -> PeriodicMotion:
    start = newton.solve_from_rest(balance, omega)
    options = Options(steps, tolerance=1e-7, max_periods=400, rigid=True)
    motion = integrate(balance, omega, start.state if start.converged else None, options)
    assert motion.periodic
    return motion


def friction_oscillator(damping: float, limit: float, omega: float) -> HarmonicBalance:
    """Den Hartog's: unit mass, spring and force."""
    one = np.ones((1, 1))
    model = ReducedModel(
        SecondOrderSystem(one, one, damping * one, {"force": one[0]}, {"mass": one[0]}), interface(one, ("t1",))
    )
    values = ContactParameters.of(("t1",), 1e3 * one, friction=1.0, normal_load=limit)
    basis, load = HarmonicBasis((0, 1, 3)), Excitation({(1, "force"): 1.0})
    return HarmonicBalance.of(model, Joint("stop", "jenkins_constant", values), basis, load, 2 * omega)


def beam(omega: float) -> HarmonicBalance:
    system = SecondOrderSystem(
        DATA["beam_M"], DATA["beam_K"], DATA["beam_D"], {"force": DATA["beam_F"]}, {"tip": DATA["beam_row"]}
    )
    values = ContactParameters.of(("t1",), 10 * DATA["beam_K"][:1, :1], friction=1.0, normal_load=1500.0)
    basis, load = HarmonicBasis((0, 1, 2, 3)), Excitation({(1, "force"): 1.0})
    model, joint = ReducedModel(system, interface(np.eye(6)[:1], ("t1",))), Joint("stop", "jenkins_constant", values)
    return HarmonicBalance.of(model, joint, basis, load, 1.2 * omega)


def oblique(omega: float) -> HarmonicBalance:
    K, n = DATA["oblique_K"], 26
    order = np.ravel(3 * np.arange(n)[:, None] + [1, 2, 0])  # its coordinates of a node are n, t1, t2
    rows = np.eye(len(K))[order] * np.tile([1, 1, -1], n)[:, None]
    preload = np.zeros(len(K))
    preload[: 3 * n : 3] = -DATA["oblique_preload"]
    loads = {"preload": preload, "force": DATA["oblique_F"]}
    masses, dampers = np.diag(DATA["oblique_M"]), np.diag(DATA["oblique_D"])
    system = SecondOrderSystem(masses, K, dampers, loads, {"response": DATA["oblique_row"]})
    model = ReducedModel(system, interface(rows, ("t1", "t2", "n")))
    springs = np.full((n, 3), 10 * np.median(np.diag(K)[: 3 * n]))
    joint = Joint("face", "coulomb_planar", ContactParameters.of(("t1", "t2", "n"), springs, friction=0.36))
    load = Excitation({(0, "preload"): 1.0, (1, "force"): 1.0})
    return HarmonicBalance.of(model, joint, HarmonicBasis((0, 1, 2, 3), transitions="sampled"), load, 1.2 * omega)


@pytest.mark.parametrize("limit", [0.3, 0.5])
def test_oscillator_without_stops_is_den_hartog(limit: float) -> None:
    """Den Hartog 1931: amplitude of an undamped mass that slides all the time; it dissipates 4 limit x amplitude."""
    ratio, angle = 0.7, np.pi / 0.7
    stretch, lag = 1 / (1 - ratio**2), np.sin(angle) / (ratio * (1 + np.cos(angle)))
    amplitude = np.sqrt(stretch**2 - (limit * lag) ** 2)
    motion = motion_of(friction_oscillator(0.0, limit, ratio), ratio, 2048)
    assert motion.amplitude[0] == pytest.approx(amplitude, rel=1e-3)
    assert motion.energy.sum() == pytest.approx(4 * limit * amplitude, rel=1e-3)


def test_oscillator_with_stops_and_its_energy_balance() -> None:
    """Stops in each half period: 0.8763086 and 1.0515703 by integration from event to event; order 2 of the balance."""
    coarse, fine = (motion_of(friction_oscillator(0.0, 0.3, 0.3), 0.3, steps) for steps in (512, 2048))
    assert fine.amplitude[0] == pytest.approx(0.8763086, rel=1e-5)
    assert fine.energy.sum() == pytest.approx(1.0515703, rel=1e-5)
    errors = [abs((m.supplied - m.damped) / m.energy.sum() - 1) for m in (coarse, fine)]
    assert [errors[0] / 16, errors[1]] == pytest.approx(errors[1:] * 2, rel=0.1)


@pytest.mark.parametrize(
    ("hertz", "amplitude", "work", "step_error"),
    [
        (28, 7.94228973e-5, 9.34883187e-4, 0.04),
        (36, 7.79240634e-5, 0.0400790039, 3e-3),
        (46, 7.06024391e-5, 0.0247420786, 2e-3),
    ],
)
def test_beam_with_a_friction_contact_is_that_of_nlstep(
    hertz: float, amplitude: float, work: float, step_error: float
) -> None:
    omega = 2 * np.pi * hertz
    motion = motion_of(beam(omega), omega, 2048)
    assert motion.amplitude[0] == pytest.approx(amplitude, rel=2e-3)
    assert motion.energy.sum() == pytest.approx(work, rel=step_error)


def test_oblique_contact_that_sticks_slips_and_lifts_is_that_of_nlstep() -> None:
    omega = 2 * np.pi * 1792.2066530835211
    motion = motion_of(oblique(omega), omega, 512)
    normal, shear = motion.force[:, 2], np.hypot(motion.force[:, 0], motion.force[:, 1])
    slips = (normal > 0) & (shear >= 0.36 * normal * (1 - 1e-9))
    assert motion.amplitude[0] == pytest.approx(2.94642623e-7, rel=1e-3)
    assert motion.energy.sum() == pytest.approx(5.45309522e-6, rel=5e-3)
    assert [(normal == 0).mean(), slips.mean()] == pytest.approx([0.3862, 0.3228], abs=3e-3)
    assert np.abs(motion.x[:, 2][normal > 0]).max() < 1e-12 * np.abs(motion.x).max()  # closed pairs do not overlap


def test_a_bar_bounces_off_a_wall() -> None:
    """It stays for two passages of the wave and leaves as fast as it came: an impact loses no energy."""
    n, speed = 200, 1.0  # unit bar: wave speed 1, mass 1
    stiffness, mass = n * (2 * np.eye(n + 1) - np.eye(n + 1, k=1) - np.eye(n + 1, k=-1)), np.full(n + 1, 1 / n)
    stiffness[0, 0] = stiffness[n, n] = n
    mass[[0, n]] /= 2
    mean = np.full(n + 1, 1 / (n + 1))
    system = SecondOrderSystem(np.diag(mass), stiffness, None, {"none": np.eye(n + 1)[0]}, {"mean": mean})
    model = ReducedModel(system, interface(np.eye(n + 1)[:1], ("n",)))
    joint = Joint("wall", "unilateral", ContactParameters.of(("n",), np.array([[float(n)]]), gap=0.5))
    omega = 2 * np.pi / 4.0
    balance = HarmonicBalance.of(model, joint, HarmonicBasis((0, 1)), Excitation({(1, "none"): 0.0}), omega)
    stepper = TimeStepper(balance, omega, Options(2048, rigid=True))
    rigid_mode, z = stepper.modes[1][:, 0], np.zeros(2 * stepper.n_dynamic)
    z[stepper.n_dynamic] = stepper.h * speed / rigid_mode[0]
    start = stepper.moving(z, balance.memory, np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(0))
    _, record, _, _ = stepper.period(start)
    force = record.f[:, 0, 0]
    closed = stepper.h * np.flatnonzero(force)
    assert [closed[0], closed[-1]] == pytest.approx([0.5, 2.5], rel=3e-2)
    eta, v = record.z[-1, : stepper.n_dynamic], record.z[-1, stepper.n_dynamic :] / stepper.h
    assert v[0] * rigid_mode[0] == pytest.approx(-speed, rel=1e-2)
    assert v @ v + eta @ (stepper.lam * eta) == pytest.approx(speed**2, rel=1e-4)


def test_a_mass_that_an_impact_would_stop_is_refused() -> None:
    one = np.ones((1, 1))
    model = ReducedModel(SecondOrderSystem(one, one, one, {"force": one[0]}, {"mass": one[0]}), interface(one, ("n",)))
    joint = Joint("stop", "unilateral", ContactParameters.of(("n",), one))
    balance = HarmonicBalance.of(model, joint, HarmonicBasis((0, 1)), Excitation({(1, "force"): 1.0}), 2.0)
    with pytest.raises(Refusal, match="a mass would be stopped by an impact"):
        TimeStepper(balance, 1.0, Options(64, rigid=True))

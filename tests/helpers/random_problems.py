"""Random small problems for the property tests: models, contact laws, loads and harmonics over many powers of ten.

`drawn_problems` draws them for hypothesis; what a matrix holds comes from a drawn seed, what decides how hard a
problem is (stiffness, friction, loads, damping, frequency, harmonics) is drawn one by one, so that hypothesis can find
the extremes and shrink to them."""

import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from hypothesis import HealthCheck, settings, strategies as st

from tests.helpers.contact_draws import EVENT_BASED, LAWS
from tests.helpers.verification_models import interface, modal_damping
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.law_check import law_numbers
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.model import ReducedModel

HARMONICS = ((0, 1), (1,), (0, 1, 2, 3), (1, 3), (0, 1, 5), (2,), tuple(range(8)))
ON_DEMAND = os.environ.get("TRIBODYN_CASES")  # cases of the first property; the others in proportion
FIRST = 250
LONGEST = 400  # cycles after which the memory of a contact counts as one that never repeats


def cases(count: int) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """So many cases, the same at every run, or as many and as new as TRIBODYN_CASES asks for."""
    scaled = count if ON_DEMAND is None else max(1, count * int(ON_DEMAND) // FIRST)
    return settings(
        max_examples=scaled, deadline=None, derandomize=ON_DEMAND is None, database=None,
        suppress_health_check=list(HealthCheck), print_blob=True,
    )  # fmt: skip


@dataclass(frozen=True)
class Drawn:
    """The numbers that a problem is made from, printed by hypothesis where a property fails.

    Powers of ten: contact [N/m] of all pairs, static and dynamic loads [N], gap [m] (signed by gap_sign)
    structure : "clamped", "rigid" (two modes that contact alone holds) or "soft" (six powers of ten between its modes)
    tuning : frequency over that of a mode of the stuck structure; memory : whether sliders start somewhere else"""

    law: str
    components: tuple[str, ...]
    n_pair: int
    n_extra: int
    structure: str
    damping: float | None
    contact: float
    contact_spread: float
    friction: float
    gap: float
    gap_sign: int
    static: float | None
    dynamic: float | None
    base: float | None
    memory: bool
    harmonics: tuple[int, ...]
    n_samples: int
    transitions: str
    tuning: float
    mode: int
    seed: int


def _power(low: int, high: int) -> st.SearchStrategy[float]:
    """Powers of ten in tenths, no bound favoured."""
    return st.sampled_from([tenth / 10 for tenth in range(10 * low, 10 * high + 1)])


@st.composite
def drawn_problems(draw: st.DrawFn, laws: list[tuple[str, tuple[str, ...]]] = LAWS) -> Drawn:
    """Numbers of a problem."""
    law, components = draw(st.sampled_from(laws))
    harmonics = draw(st.sampled_from(HARMONICS))
    ways = ("sampled", "located") if (law, components) in EVENT_BASED else ("sampled",)
    return Drawn(
        law=law, components=components, n_pair=draw(st.integers(1, 4)), n_extra=draw(st.integers(0, 4)),
        structure=draw(st.sampled_from(("clamped", "rigid", "soft"))),
        damping=draw(st.sampled_from((0.01, None, 0.0, 1e-4, 0.3, 1.0))), contact=draw(_power(1, 13)),
        contact_spread=draw(st.sampled_from((0.0, 0.3, 2.0))),
        friction=draw(st.sampled_from((0.3, 0.0, 1e-3, 1.0, 10.0))), gap=draw(_power(-9, 0)),
        gap_sign=draw(st.sampled_from((0, 1, -1))), static=draw(st.none() | _power(-3, 6)),
        dynamic=draw(st.none() | _power(-6, 6)), base=draw(st.none() | _power(-9, -2)), memory=draw(st.booleans()),
        harmonics=harmonics, n_samples=draw(st.integers(2 * harmonics[-1] + 1, 96)),
        transitions=draw(st.sampled_from(ways)),
        tuning=draw(st.sampled_from((0.9, 0.01, 0.3, 0.999, 1.0, 1.1, 3.0))), mode=draw(st.integers(0, 3)),
        seed=draw(st.integers(0, 2**16)),
    )  # fmt: skip


def structure_of(d: Drawn, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness of the structure without contact."""
    n = len(d.components) * d.n_pair + d.n_extra
    mass = np.diag(10 ** rng.uniform(-1, 1, n))
    a = rng.normal(size=(n, n))
    mass += 0.1 * a @ a.T * np.min(np.diag(mass)) / n
    modes = np.linalg.qr(rng.normal(size=(n, n)))[0]
    spread = {"clamped": 2.0, "rigid": 2.0, "soft": 6.0}[d.structure]
    values = 1e5 * 10 ** rng.uniform(0, spread, n)
    if d.structure == "rigid":
        values[: min(2, n - 1)] = 0.0
    return mass, (modes * values) @ modes.T


def problem_of(d: Drawn) -> HarmonicBalance:
    """The balance of a drawn problem, its omega in `frequency_of`."""
    rng = np.random.default_rng(d.seed)
    n_contact = len(d.components) * d.n_pair
    mass, stiffness = structure_of(d, rng)
    n = len(mass)
    damping = None if d.damping is None else modal_damping(mass, stiffness, d.damping)
    static, shaker = rng.normal(size=(2, n))
    if "n" in d.components:  # most presses, some pull
        static[d.components.index("n") : n_contact : len(d.components)] += 1.0
    outputs = {"tip": np.eye(n)[-1]}
    system = SecondOrderSystem(mass, stiffness, damping, {"static": static, "shaker": shaker}, outputs)
    model = ReducedModel(system, interface(np.eye(n_contact, n), d.components))
    spread = 10 ** (d.contact + d.contact_spread * rng.normal(size=(d.n_pair, len(d.components))))
    gap = d.gap_sign * 10**d.gap * rng.uniform(0, 1, d.n_pair)
    load = 0.0 if d.static is None else 10**d.static
    parameters = ContactParameters.of(
        d.components,
        spread,
        gap=gap,
        **law_numbers(
            d.law,
            friction=d.friction,
            normal_load=load * rng.uniform(0, 1, d.n_pair),
            slip_force=load * d.friction,
            free=10**d.contact * 10 ** rng.uniform(-3, 3, d.n_pair),
        ),
    )
    basis = HarmonicBasis(d.harmonics, d.n_samples, d.transitions)
    loads: dict[tuple[int, str], complex] = {}
    if d.static is not None and basis.has_static:
        loads[(0, "static")] = load
    if d.dynamic is not None:
        loads[(basis.dynamic[0], "shaker")] = 10**d.dynamic * np.exp(1j * rng.uniform(0, 6))
    base = None if d.base is None else 10**d.base * rng.normal(size=(n_contact, basis.n_coeff))
    law = contact_law.load(d.law)
    memory = None
    if d.memory:
        memory = 10**d.gap * rng.normal(size=(d.n_pair, law.n_state(d.components)))
    omega = frequency_of(d, mass, stiffness, spread)
    return HarmonicBalance.of(
        model, Joint("contact", d.law, parameters), basis, Excitation(loads, base), omega * 1.5, memory
    )


def frequency_of(d: Drawn, mass: np.ndarray, stiffness: np.ndarray, springs: np.ndarray) -> float:
    """Frequency [rad/s] beside a mode of the stuck structure."""
    k = np.zeros(len(mass))
    k[: springs.size] = springs.ravel()
    lam = sla.eigh(stiffness + np.diag(k), mass, eigvals_only=True)
    return float(d.tuning * np.sqrt(max(lam[min(d.mode, len(lam) - 1)], 1.0)) / d.harmonics[-1])


def omega_of(balance: HarmonicBalance) -> float:
    """The frequency that a drawn problem is meant for [rad/s]."""
    return balance.omega_max / 1.5


def contact_forces(balance: HarmonicBalance, x: np.ndarray) -> np.ndarray:
    """(n_contact, n_coeff) contact forces [N] at x by stepping the law through the cycle from one sample to the next.

    The memory is the one at which a march from the start of the load path repeats. Nothing is shared with the solver
    but the law's step, for planar friction that along a chord, which begins at its memory. Returns nan where the memory
    does not repeat within LONGEST cycles"""
    joint, basis = balance.contact.joints[0], balance.basis
    law, p = joint.module, joint.parameters.packed()
    n_pair, n_comp, _ = x.shape
    step, start = law.step, balance.memory
    if hasattr(law, "chord"):
        step, start = law.chord, np.concatenate([start, start, joint.parameters.gap[:, None]], axis=1)
    if basis.transitions == "located":
        force = aft.cycle(law, x, joint.parameters, basis, balance.memory, jacobian=False).force
        return force.reshape(n_pair * n_comp, -1)
    angle = 2 * np.pi * np.arange(basis.n_samples) / basis.n_samples
    columns = [np.ones_like(angle)] if 0 in basis.harmonics else []
    for h in basis.harmonics:
        columns += [np.cos(h * angle), np.sin(h * angle)] if h else []
    phi = np.stack(columns, axis=1)
    forces = np.zeros((n_pair, n_comp, basis.n_samples))
    for i in range(n_pair):
        path, memory = phi @ x[i].T, start[i].copy()
        n_state = len(memory)
        for _ in range(LONGEST):
            before, size = memory.copy(), np.abs(memory).max(initial=0.0)
            for j, at in enumerate(path):
                f = np.zeros(n_comp)
                slopes = [np.zeros((a, b)) for a in (n_comp, n_state) for b in (n_comp, n_state)]
                step(np.ascontiguousarray(at), memory, p[i], f, *slopes)
                size = max(size, np.abs(memory).max(initial=0.0))
                forces[i, :, j] = f
            if np.abs(memory - before).max(initial=0.0) <= 1e-12 * size:
                break
        else:
            forces[i] = np.nan
    weight = np.where(np.array(basis.order) == 0, 1.0, 2.0) / basis.n_samples
    return (forces @ (phi * weight)).reshape(n_pair * n_comp, -1)


def displacement_under(balance: HarmonicBalance, omega: float, x: np.ndarray, force: np.ndarray) -> np.ndarray:
    """(n_contact, n_coeff) relative displacement [m] that dense solves with the contact forces at x give back.

    One complex solve for each harmonic of the whole system, with the contact springs on both sides."""
    system, b = balance.model.system, np.asarray(balance.model.interface.B)
    basis, k = balance.basis, balance.contact.stiffness.ravel()
    damping = np.zeros_like(system.mass) if system.damping is None else system.damping
    flat = x.reshape(len(k), -1)
    base = np.zeros_like(flat) if balance.excitation.base is None else balance.excitation.base
    spring = basis.to_complex(k[:, None] * (flat + base) - force)
    back = np.zeros_like(spring)
    for position, h in enumerate(basis.harmonics):
        load = sum((v * system.loads[name] for (at, name), v in balance.excitation.loads.items() if at == h), 0j)
        s = 1j * h * omega
        dynamic = system.stiffness + b.T @ (k[:, None] * b) + s * damping + s * s * system.mass
        driven = load + b.T @ spring[:, position]
        if driven.any():  # an undamped resonance that nothing drives stays at rest
            back[:, position] = b @ np.linalg.solve(dynamic, driven)
    return basis.to_real(back) - base

"""What every contact law must obey, tried on random pairs in units of order one: for a user's law, and by the tests."""

from os import PathLike, fspath

import numpy as np

from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, ContactCycle, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.refusal import SolverFailure

Value = np.ndarray | float
MOST = {  # what the errors may be
    "derivatives of a step": 1e-5, "pull or force when open": 0.0, "no status or force": 0,
    "derivatives of a cycle": 1e-6, "energy from nothing": 1e-13, "loss without slip": 1e-3,
    "no repeating cycle": 1e-11,
}  # fmt: skip


def law_numbers(law: str, free: Value = 0.0, **by_role: Value) -> dict[str, Value]:
    """Values of the numbers that a law declares, in its order; free : of those without a role, within their limits."""
    values = {}
    for number in contact_law.declared(law):
        low = number.low if number.above is None else number.above + 1e-3 * (1 + abs(number.above))
        limited = free if low is None and number.high is None else np.clip(free, low, number.high)
        values[number.name] = by_role.get(number.role or "", limited)
    return values


def draw(
    law: str, components: tuple[str, ...], basis: HarmonicBasis, n_pair: int, seed: int
) -> tuple[np.ndarray, ContactParameters, np.ndarray]:
    """Displacement, parameters and memory of pairs that stick, slip, separate, or do all of it in one cycle."""
    rng = np.random.default_rng(seed)
    stiffness = rng.uniform(0.5, 2, (n_pair, len(components)))
    gap = rng.normal(size=n_pair) * 0.3 - (0.0 if basis.has_static else rng.uniform(0, 2, n_pair))
    friction, load, free = rng.uniform(0.1, 0.8, n_pair), rng.uniform(0, 1, n_pair), rng.uniform(0, 1, n_pair)
    numbers = law_numbers(law, free, friction=friction, normal_load=load, slip_force=friction)
    size = 10 ** rng.uniform(-1.5, 0.5, (n_pair, 1, 1))
    x = rng.normal(size=(n_pair, len(components), basis.n_coeff)) * size / (1 + basis.order)
    if "n" in components and basis.has_static:
        x[:, -1, 0] += rng.uniform(-0.5, 3, n_pair)
    n_state = contact_law.load(law).n_state(components)
    memory = rng.normal(size=(n_pair, n_state)) * rng.integers(0, 2, (n_pair, 1))
    return x, ContactParameters.of(components, stiffness, gap=gap, table=None, **numbers), memory


def errors_of_steps(law: str, components: tuple[str, ...]) -> dict[str, float]:
    """Of single steps: derivatives by differences of order six where the status stays, sign, status bits."""
    module, basis, n = contact_law.load(law), HarmonicBasis((0, 1), 8), len(components)
    x, parameters, memory = draw(law, components, basis, 100, seed=1)
    moving, timed = aft.with_velocity(module, x, parameters, basis, 1.0)
    width, slopes, pulls, opened, missing = moving.shape[1], [0.0], [0.0], [0.0], 0

    def step(z: np.ndarray, p: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:
        s, f, sizes = z[width:].copy(), np.append(np.full(n, np.nan), np.zeros(width - n)), (width, memory.shape[1])
        d = [np.zeros((a, b)) for a in sizes for b in sizes]
        return module.step(z[:width].copy(), s, p, f, *d), np.append(f, s), np.block([d[:2], d[2:]])

    for z, p in zip(np.hstack([moving @ basis.synthesis[3], memory]), timed.packed(), strict=True):
        bits, out, slope = step(z, p)
        missing += not 0 < bits < 8 or not np.isfinite(out[:n]).all() or bool(out[n:width].any())
        pulls.append(-out[n - 1] if components[-1] == "n" else 0.0)
        opened += [np.abs(out[:n]).max()] if bits == SEPARATES else []
        for column, direction in enumerate(1e-3 * np.eye(len(z))):
            nearby = {k: step(z + k * direction, p) for k in (-3, -2, -1, 1, 2, 3)}
            if all(b == bits for b, _, _ in nearby.values()):
                sides = [nearby[k][1] - nearby[-k][1] for k in (1, 2, 3)]
                fourth = (8 * sides[0] - sides[1]) / 12e-3
                difference = (45 * sides[0] - 9 * sides[1] + sides[2]) / 60e-3
                size = 1 + np.abs(difference).max()
                if np.abs(fourth - difference).max() < 1e-7 * size:  # no slider of several begins to slip in between
                    slopes.append(np.abs(slope[:, column] - difference).max() / size)
    pull = max(*pulls, *opened) if len(opened) > 1 else 0.0  # a spring that never opens may pull
    return dict(zip(MOST, (max(slopes), pull, missing), strict=False))


def errors_of_cycles(law: str, components: tuple[str, ...], way: str) -> dict[str, float]:
    """Of periodic cycles: derivatives, energy, begin at another time; way : in which transitions are taken."""
    module, basis, angle = contact_law.load(law), HarmonicBasis((0, 1, 2, 3), 256, way), 7 * 2 * np.pi / 256
    x, parameters, memory = draw(law, components, basis, 60, seed=7)
    t = [i for i, c in enumerate(components) if c != "n"]

    def cycle(x: np.ndarray, jacobian: bool = False) -> ContactCycle:
        return aft.cycle(module, x, parameters, basis, memory, jacobian, omega=1.0)

    base, shifted = cycle(x, True), cycle(basis.shift(x, angle))
    direction = np.random.default_rng(4).normal(size=x.shape) * np.abs(x).max(axis=(1, 2), keepdims=True)
    coarse, fine = ((cycle(x + e * direction).force - cycle(x - e * direction).force) / (2 * e) for e in (2e-6, 1e-6))
    exact = (base.slope @ direction.reshape(len(x), -1, 1)).reshape(x.shape)
    jumps, miss, size = (np.abs(change).max(axis=(1, 2)) for change in (coarse - fine, fine - exact, exact))
    late = np.abs(shifted.force - basis.shift(base.force, angle)).max(axis=(1, 2)) / np.abs(base.force).max()
    work = basis.work_per_cycle(base.force, x)[:, t] / (np.abs(base.force).max() * np.abs(x).max())
    lifts, slips = (base.status & bit > 0 for bit in (SEPARATES, SLIPS))
    elastic = ~slips & (not contact_law.needs_velocity(module))
    errors = (
        np.quantile(miss[jumps < 1e-6 * size] / (1e-30 + size[jumps < 1e-6 * size]), 0.95),
        -work[~lifts | (way == "located")].min(initial=0.0),  # a pair that lifts between samples does not count
        np.abs(work[elastic]).max(initial=0.0),
        late[slips | (module.n_state(components) == 0)].max(initial=0.0),
    )
    return dict(zip(list(MOST)[3:], errors, strict=True))


def check_law(law: str | PathLike[str]) -> str:
    """Try a contact law on random pairs that stick, slip and separate: the largest error of each kind, a line each.

    law : a file such as "my_law.py", which this runs, or the name of a law that comes along
    Raises  Refusal: no such law"""
    name, errors = fspath(law), dict.fromkeys(MOST, 0.0)
    for components in (module := contact_law.load(name)).COMPONENTS:
        parts = [errors_of_steps(name, components)]
        for way in ("sampled", "located") if contact_law.is_event_based(module) else ("sampled",):
            try:
                parts.append(errors_of_cycles(name, components, way))
            except SolverFailure:
                parts.append({"no repeating cycle": np.inf})
        for part in parts:
            errors |= {kind: max(errors[kind], float(value)) for kind, value in part.items()}
    bad = {kind for kind, value in errors.items() if not value <= MOST[kind]}
    lines = [f"{'BAD' if k in bad else 'ok':3} {k:24} {v:.1e} (at most {MOST[k]:g})" for k, v in errors.items()]
    return "\n".join([f"{contact_law.name_of(module)}: {'not a contact law yet' if bad else 'passed'}", *lines])

"""Residual shear: what a stuck contact keeps of its load path, and how far the response depends on it.

A pair that slips or lifts once in every cycle forgets how it was loaded. A pair that sticks all the time does not: its
slider may stand anywhere between the two ends at which the cycle just fits into the friction limit, so its static shear
is free within that range, and with it the static balance, the normal loads, and what the other pairs do.

The start that a HarmonicBalance uses by default is the unloaded one: all sliders at zero, that is, contact
closes without shear and a stuck pair bears the shear that the loads put on it, or as much of it as friction holds. The
bounds start instead from sliders that are far away on one side. The first cycle drags them to the end of the range that
belongs to the motion, where they stay (a Jenkins slider settles in one cycle, at that end exactly), so one solve finds
motion and extreme memory together; pairs that slip or lift are not touched by it.

All pairs are pushed to the same side, or each to the side that raises the vibration of one output, to first order about
the unloaded solution. The bounds so found are reached by some load path; that no other path goes beyond is not proven.
Source  Ferhatoglu and Zucca 2021 (range of residual tractions and its effect); extreme starts as a far memory are ours.
"""

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.declarations import Role
from tribodyn.hbm import harmonics, newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.newton import NewtonOptions, Solution, lead
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal, SolverFailure

START_OFFSET = 1e4  # times the largest travel of a slider that the unloaded cycle allows
# Relative deviation of the vibrating force of a stuck pair from that of its spring: rounding and Newton leave less.
SPRING_DEVIATION = 1e-9


@dataclass(frozen=True)
class ResponseBounds:
    """Solutions at one frequency from the unloaded start and from the two extreme ones, always in this order.

    solutions : (unloaded, negative, positive); a solution that failed says so in its outcome and widens no range
    direction : (n_pair, n_tangential) side of the shear in the positive start, +1 or -1
    shear : (3, n_pair, n_tangential) static shear force [N]
    stuck : (3, n_pair, n_tangential) whether the pair sticks all the time: where it does, shear is free in between
    response : (3, n_output, n_coeff) outputs [m]; amplitude : (3, n_output) of their vibration [m]
    energy : (3,) friction work per cycle, all pairs [J]"""

    solutions: tuple[Solution, Solution, Solution]
    direction: np.ndarray
    shear: np.ndarray
    stuck: np.ndarray
    output_names: tuple[str, ...]
    response: np.ndarray
    amplitude: np.ndarray
    energy: np.ndarray

    @property
    def converged(self) -> np.ndarray:
        """(3,) whether each start led to a solution."""
        return np.array([s.converged for s in self.solutions])

    def amplitude_range(self, output: str) -> tuple[float, float]:
        """Least and largest vibration amplitude of an output, see `hbm.harmonics.amplitude` [m]."""
        return self._range(self.amplitude[:, self.output_names.index(output)])

    def energy_range(self) -> tuple[float, float]:
        """Least and largest friction work per cycle [J]."""
        return self._range(self.energy)

    def _range(self, value: np.ndarray) -> tuple[float, float]:
        if not self.converged.any():
            raise SolverFailure(f"none of the three starts led to a solution: {self.solutions[0].outcome}")
        return float(value[self.converged].min()), float(value[self.converged].max())


@single
def response_bounds(
    balance: HarmonicBalance,
    omega: float,
    start: np.ndarray | None = None,
    output: str | None = None,
    options: NewtonOptions | None = None,
) -> ResponseBounds:
    """Solve from the unloaded and from the two extreme starts of the friction memory.

    omega : [rad/s]; start : (n_pair, n_component, n_coeff) guess for the unloaded solution [m], from rest if None
    output : pairs are pushed to the side that raises the vibration of this output; all to the same side if None
    Raises  ValueError where the law has no friction memory or harmonic 0 is not kept"""
    tangential = _check(balance)
    if start is None:
        unloaded = newton.solve_from_rest(balance, omega, options)
    else:
        unloaded = newton.solve(balance, omega, start, options)
    direction = np.ones(balance.memory.shape)
    if output is not None and unloaded.converged:
        slope = amplitude_slope(balance, unloaded.state, output)
        direction = np.where(slope < 0, -1.0, 1.0)
    reach = _reach(balance, unloaded.state, tangential)
    negative = _solve_pushed(balance, unloaded, -direction, reach, options)
    positive = _solve_pushed(balance, unloaded, direction, reach, options)
    solutions = (unloaded, negative, positive)
    states = [s.state for s in solutions]
    outputs = np.stack([balance.outputs(s) for s in states])
    return ResponseBounds(
        solutions,
        direction,
        np.stack([s.cycle.force[:, tangential, 0] for s in states]),
        np.stack([stuck(balance, s) for s in states]),
        balance.compliance.output_names,
        outputs,
        harmonics.amplitude(outputs, balance.basis.harmonics),
        np.array([balance.energy(s).sum() for s in states]),
    )


def stuck(balance: HarmonicBalance, state: State) -> np.ndarray:
    """(n_pair, n_tangential) whether a direction sticks all the time: its vibrating force is that of its spring."""
    t = _check(balance)
    linear = balance.contact.stiffness[:, t, None] * state.x[:, t, 1:]
    error = np.abs(state.cycle.force[:, t, 1:] - linear).max(axis=2)
    is_stuck = error <= SPRING_DEVIATION * np.abs(balance.contact.stiffness[:, t, None] * state.x[:, t]).max()
    return is_stuck & balance.contact.has_component[:, t]


@single
def amplitude_slope(balance: HarmonicBalance, state: State, output: str, tolerance: float = 1e-6) -> np.ndarray:
    """Derivative of the vibration amplitude of an output with respect to the residual shear of each stuck direction.

    All other stuck sliders stand still. One linear solve for each direction.
    Returns (n_pair, n_tangential) [m/N], zero where the pair does not stick"""
    t = _check(balance)
    linear, point = balance.linearise(_with_sliders_held(balance, state)), balance.at(state.omega)
    row = balance.compliance.output_names.index(output)
    weight = harmonics.amplitude_slope(balance.outputs(state)[row], balance.basis.harmonics)
    slope = np.zeros((len(state.x), len(t)))
    for pair, c in np.argwhere(stuck(balance, state)):
        g = np.zeros(state.g.shape)
        g[pair * state.x.shape[1] + t[c], 0] = -1.0  # one newton more of shear, g = k x - f
        dx, _, _ = linear.solve(point.apply(g), tolerance)
        change = point.outputs(g + linear.departure_slope(dx))[row]
        slope[pair, c] = weight @ change
    return slope


def _with_sliders_held(balance: HarmonicBalance, state: State) -> State:
    """The state with the derivative of springs where a direction sticks, also where its slider stands on the rim."""
    m = balance.basis.n_coeff
    jac = state.cycle.slope.copy()
    tangential = _check(balance)
    for pair, c in np.argwhere(stuck(balance, state)):
        block = slice(tangential[c] * m, (tangential[c] + 1) * m)
        jac[pair, block] = 0.0
        jac[pair, block, block] = balance.contact.stiffness[pair, tangential[c]] * np.eye(m)
    return replace(state, cycle=replace(state.cycle, jacobian=jac))


def _check(balance: HarmonicBalance) -> list[int]:
    """Positions of the components whose sliders are the memory of the law."""
    tangential = balance.contact.tangential
    for joint in balance.contact.joints:
        tangential_of_joint = joint.parameters.tangential
        if joint.n_state != len(tangential_of_joint) or not tangential:
            raise Refusal(f"contact law '{joint.law}' keeps no slider: there is no residual shear to bound")
        if [balance.contact.columns(joint)[c] for c in tangential_of_joint] != tangential[: len(tangential_of_joint)]:
            raise Refusal(f"joint '{joint.name}' sees {joint.parameters.components}: give it t1 to bound its shear")
    if not balance.basis.has_static:
        raise Refusal("residual shear is a static force: keep harmonic 0 to bound the response")
    return tangential


def _reach(balance: HarmonicBalance, state: State, tangential: list[int]) -> np.ndarray:
    """(n_pair, n_tangential) travel of a slider from one end of its range to the other, at most [m]."""
    contact = balance.contact
    load = contact.number(Role.NORMAL_LOAD)
    if "n" in contact.components:
        load = np.maximum(load, np.abs(state.cycle.force[:, -1]).sum(axis=1))
    k = contact.stiffness[:, tangential]
    limit = (contact.number(Role.FRICTION) * load + contact.number(Role.SLIP_FORCE))[:, None]
    return np.divide(2 * limit, k, out=np.zeros_like(k), where=k > 0) + np.abs(state.x[:, tangential]).sum(axis=2)


def _solve_pushed(
    balance: HarmonicBalance, unloaded: Solution, side: np.ndarray, reach: np.ndarray, options: NewtonOptions | None
) -> Solution:
    """The solution whose stuck pairs bear all the shear they can on the given side.

    Where Newton does not get there at once, the sliders are moved out in steps that halve when one fails."""
    x, omega = unloaded.state.x, unloaded.state.omega
    far = -side * START_OFFSET * max(reach.max(), np.finfo(float).tiny)
    solution = newton.solve(balance.with_memory(far), omega, x, options)
    if solution.converged or not unloaded.converged:
        return solution

    def pushed(target: float, _: float) -> bool:
        nonlocal x
        trial = newton.solve(balance.with_memory(balance.memory - target * side * reach), omega, x, options)
        x = trial.state.x if trial.converged else x
        return trial.converged

    if lead(0.0, 1.0, pushed) < 1.0:
        return solution
    return newton.solve(balance.with_memory(far), omega, x, options)

"""Folds of a frequency response, followed while a second parameter changes: load, gap, stiffness, wear.

The line of folds is followed by its own arc length on the surface of solutions, round the cusps where two folds meet;
see `fold_surface`."""

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.continuation.bordered import Direction
from tribodyn.hbm.continuation.fold_surface import FoldOptions, FoldPoint, NoFold, SolutionSurface
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.outcome import BranchEnd, Outcome
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class FoldCurve:
    """A line of folds in the order it was followed.

    parameter_name : what was changed; parameter : (n_point,) its values; omega : (n_point,) of the folds [rad/s]
    output_names; response : (n_point, n_output, n_coeff) of the `harmonics` [m]
    contact : (n_point, n_contact, n_coeff) [m]
    cusps : indices of the points next to which the parameter turns back: two folds meet there and vanish
    end : why and where it ends; its text is a sentence"""

    parameter_name: str
    parameter: np.ndarray
    omega: np.ndarray
    output_names: tuple[str, ...]
    response: np.ndarray
    contact: np.ndarray
    harmonics: tuple[int, ...]
    cusps: tuple[int, ...]
    end: Outcome[BranchEnd]

    def amplitude(self, output: str) -> np.ndarray:
        """(n_point,) vibration amplitude of an output at the folds [m]."""
        return amplitude(self.response[:, self.output_names.index(output)], self.harmonics)


@single
def track_fold(
    path: Parameter, start: float, stop: float, omega: float, x: np.ndarray, options: FoldOptions | None = None
) -> FoldCurve:
    """Follow a fold of the frequency response from `start` of a parameter towards `stop`.

    path : the second parameter, such as `parameter.load(balance, omega)`; its own frequency is not used
    omega, x (n_pair, n_component, n_coeff) : the fold at `start`, or near it, as a Branch lists it [rad/s], [m]
    Returns the line of folds; it may turn back at a cusp and then ends where it passes `start` or `stop`
    Raises  Refusal where there is no fold near the start"""
    options = options or FoldOptions()
    if path.omega is None:
        raise Refusal("a fold is followed against a second parameter, such as the load, not against the frequency")
    if start == stop:
        raise Refusal(f"start and stop are the same, {path.say(start)}: there is no fold to follow")
    surface = SolutionSurface(path, options, omega, abs(stop - start))
    try:
        point = surface.first(start, Direction(x.reshape(-1, x.shape[-1]), omega), float(np.sign(stop - start)))
    except NoFold as reason:
        raise Refusal(f"no fold near {omega / (2 * np.pi):.6g} Hz at {path.say(start)}: {reason}") from None
    line, step = [point], options.step
    end: Outcome[BranchEnd] | None = None
    low, high = min(start, stop), max(start, stop)
    while end is None:
        if len(line) >= options.max_points:
            end = BranchEnd.ENDED.say(f" {path.say(point.value)}: {options.max_points} points were allowed")
            break
        following, trouble = None, ""
        while following is None and step >= options.min_step:
            try:
                following = surface.ahead(point, step)
            except NoFold as reason:
                step, trouble = 0.5 * step, str(reason)
        if following is None:
            end = BranchEnd.ENDED.say(f" {path.say(point.value)}: {trouble}")
            break
        bound = low if following.value < low else high if following.value > high else None
        if bound is not None:
            share = (bound - point.value) / (following.value - point.value)
            guess = point.place + (following.place - point.place) * share
            try:
                following = surface.at(bound, guess, point)
                end = (BranchEnd.TURNED_BACK if bound == start else BranchEnd.REACHED).say(f" {path.say(bound)}")
            except NoFold as reason:
                end = BranchEnd.ENDED.say(f" {path.say(point.value)}: {reason}")
                break
        line.append(following)
        step = float(np.clip(surface.next_step(point, following, step), options.min_step, options.max_step))
        point = following
    return _fold_curve(path, line, end)


def _fold_curve(path: Parameter, line: list[FoldPoint], end: Outcome[BranchEnd]) -> FoldCurve:
    values = np.array([point.value for point in line])
    balance, steps = path.make(line[0].value), np.diff(values)
    return FoldCurve(
        path.name,
        values,
        np.array([point.solution.state.omega for point in line]),
        balance.compliance.output_names,
        np.stack([path.make(point.value).outputs(point.solution.state) for point in line]),
        np.stack([point.solution.state.flat for point in line]),
        balance.basis.harmonics,
        tuple(int(i) for i in np.flatnonzero(steps[1:] * steps[:-1] < 0) + 1),
        end,
    )

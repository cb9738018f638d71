"""How exactly derivatives are solved for, and why there may be none."""

from dataclasses import dataclass

from tribodyn.refusal import SolverFailure


class NoDerivative(SolverFailure):
    """There is no derivative here; the message says why."""


@dataclass(frozen=True)
class DerivativeRules:
    """How exactly is solved, and what counts as a corner. Half widths are those of the resonance."""

    state_tolerance: float = 1e-12  # relative residual of the states at which derivatives are taken
    adjoint_tolerance: float = 1e-12  # relative residual of an adjoint, and the largest of one that counts
    adjoint_limit: float = 1e-7
    adjoint_products: int = 400
    gap_step: float = 1e-6  # over the largest displacement
    curve_step: float = 2e-4  # half widths from a peak to two points of the gradient along the curve
    max_steps: int = 12  # to a peak, and the first of them over the frequency
    first_step: float = 1e-5
    peak_tolerance: float = 1e-7  # half widths between a peak and its prediction
    corner_width: float = 1e-8  # half widths between both sides of a corner, and the first of four points near it
    corner_sides: tuple[float, float] = (-3e-4, 3e-4)
    # difference of one-sided derivatives over their size from which on they are two, and the least share of the largest
    # effect of any parameter that counts as a size
    corner: float = 1e-2
    least_effect: float = 1e-3
    # of a wear law: relative step of its numbers, and of the gap; a slope that differs from that by `gap_step` shows
    # that the law counts samples of a force with jumps
    law_step: float = 1e-3


RULES = DerivativeRules()

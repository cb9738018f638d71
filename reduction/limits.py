"""Limits of the reductions: what is small, what is many, and how much is worked on at once."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ReductionLimits:
    """Counts where there is no unit; none of them changes a result beyond what its line says.

    point_load : DOFs of a load or output above which it makes no masters, but static shapes
    reported_modes : natural frequencies that a model reports
    solved_at_once, static_at_once : right-hand sides of constraint modes and of static shapes; memory only
    turned_at_once : rows of the shapes that are turned in place; memory only
    most_modes : below a cutoff: dense matrices of more modes, and their eigensolve, take minutes
    many_coordinates : coordinates of a wave from which on its damping and compliance cost more than `stuck_ritz`
    many_on_line, modes_on_line : the same along a range of speeds, where these are computed anew at every one
    speed_spacing_error : relative error of frequencies between the speeds of a line
    ritz_modes : modes of `stuck_ritz`, as many as the compliance is expanded in at the most
    clusters : of pairs, each with a uniform traction for every component; docs/theory/residual_flexibility.md
    power_steps, power_vectors : of the iteration that measures how much flexibility is left out
    recalled : forces whose columns residual flexibility was asked for and that are kept, to say that of forces near by
    dependent : share of its strain energy that a static shape must add to the others to be kept
    new_direction : size of what modes lack of a shape, relative, below which it is rounding
    rounding : of the rows of a contact map
    nearly_free : share of the contact springs in the second set of nominal modes: a contact that slips is nearly free
    static_frequency : frequency, over the highest wanted one, that is given to shapes which stand for all static ones
    negligible : compliance of such a shape, over the largest, that is left out"""

    point_load: int = 30
    reported_modes: int = 10
    solved_at_once: int = 128
    static_at_once: int = 16
    turned_at_once: int = 4096
    most_modes: int = 1000
    many_coordinates: int = 1000
    many_on_line: int = 300
    modes_on_line: int = 48
    speed_spacing_error: float = 1e-6
    ritz_modes: int = 192
    clusters: int = 64
    power_steps: int = 6
    power_vectors: int = 4
    recalled: int = 4
    dependent: float = 1e-10
    new_direction: float = 1e-6
    rounding: float = 1e-9
    nearly_free: float = 0.05
    static_frequency: float = 100.0
    negligible: float = 1e-14


LIMITS = ReductionLimits()

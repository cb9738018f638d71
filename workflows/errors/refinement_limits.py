"""The numbers of the error system: what is refined, how much work that may be, and the rule of the total error."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RefinementLimits:
    """Limits count DOFs, unknowns and solves, never seconds: the same scene has the same errors on every machine.

    ratios : elements along every edge over those of the scene; the first that the limits allow is taken, else `coarser`
    modes : retained modes, or their cutoff, over those of the scene
    highest : harmonic that the contact force is searched to for what the balance leaves out, and half as many again
    harmonic_rounds : times that harmonics are taken in; searched : share of the response that they change, from which
        on another peak may be the highest; harmonic_share : of the floor, that others may leave out
    max_dofs : of the refined mesh; some 20 s to reduce on one core
    max_unknowns : of the refined balance; some 10 s to find its peak on one core
    max_wear : unknowns of the refined balance times solves of the scene's own wear, and components of its contact times
        periods in time, up to which that is worn; above it a coarser mesh is
    coarser : elements along every edge of the scene over those of the coarser mesh
    wear_steps : on the refined mesh over those of the scene
    max_time : squared components of a contact times steps of a period, up to which its motion is integrated in time;
        some 20 s on one core
    searched_rows : wear states at which a periodic motion is searched that an irregular one did not take
    order : of convergence that is relied on: errors at contact kinks and corners fall with the element size
    safety : on the extrapolated error (Roache 1994: 1.25)
    floor : least change that a refinement counts with: two models agree by chance on small errors
    largest : relative error above which a value is not reported
    max_runs : to a requested accuracy; share : of the requested error, below which a refinement is not made
    finer : elements along every edge of the next of these runs over those of the last"""

    ratios: tuple[float, ...] = (2.0, 1.5)
    modes: int = 2
    highest: int = 24
    harmonic_rounds: int = 2
    searched: float = 0.02
    harmonic_share: float = 0.5
    max_dofs: int = 100_000
    max_unknowns: int = 5000
    max_wear: float = 4e5
    coarser: float = 1.5
    wear_steps: float = 2.0
    max_time: float = 2e8
    searched_rows: int = 12
    order: float = 1.0
    safety: float = 1.25
    floor: float = 1e-3
    largest: float = 0.5
    max_runs: int = 8
    share: float = 0.2
    finer: float = 1.5

    def factor(self, ratio: float | None) -> float:
        """Total error over the change by another mesh with so many times the elements along every edge.

        Source  Roache, J. Fluids Eng. 116 (1994), grid convergence index of the coarser of two grids, and of the finer
        one where the other mesh is coarser"""
        return self.safety / abs(1 - (ratio or self.ratios[0]) ** -self.order)

    def total(self, change: float, ratio: float | None) -> float:
        """Total relative error of a value that the combined refinement changes so much."""
        return self.factor(ratio) * max(change, self.floor)


DEFAULT = RefinementLimits()

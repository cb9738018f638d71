"""Whether a contact has another motion at a frequency that is not that of a peak: a verdict follows one alone."""

from __future__ import annotations

from collections.abc import Iterator

from tribodyn.hbm import newton
from tribodyn.hbm.continuation import harmonic_choice
from tribodyn.hbm.continuation.arrivals import arrivals
from tribodyn.hbm.continuation.operating_point import AtFrequency, AtPeak, OperatingPoint
from tribodyn.hbm.continuation.sites import BesidePeak
from tribodyn.workflows.accuracy.probes import Answers, OnCurve, State, compared, relative
from tribodyn.workflows.accuracy.statement import Contribution
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds

SOURCE = "another motion"
OF_MOTION = ("amplitude", "energy", "preload")
CONCERNED = (*OF_MOTION, "depth", "life")
RICH = 5  # highest harmonic that motions are looked for with, at the least: some need more than one or three
SAME = 0.01  # relative difference in every answer up to which two motions count as one


def contributions(state: State, seconds: float, skipped: str) -> Iterator[Contribution]:
    """What other motions at the frequency of a state add to its errors; nothing at a peak.

    seconds : of the processor; skipped : the sentence where they are used up
    A difference is known. Which motion a machine makes depends on what was before, and where there are two there may be
    more: the error of an answer is then not known
    """
    site = state.site
    if isinstance(site, AtPeak | OnCurve):
        return
    found: list[tuple[Answers, Answers]] = []
    how = "sweeps up and down and a falling load to the same frequency"
    try:
        with processor_seconds(seconds):
            for highest in _tops(state):
                found.extend(others(state, site, highest))
    except TimeUp:
        if not found:
            yield from (Contribution(SOURCE, name, None, skipped) for name in CONCERNED)
            return
        how += ", as far as the seconds went"
    errors = dict.fromkeys(OF_MOTION, 0.0)
    for ours, theirs in found:
        for name, a, b in compared(ours, theirs):
            if name in errors:
                errors[name] = max(errors[name], relative(a, b))
    for name, error in errors.items():
        yield Contribution(SOURCE, name, error, how)
    yield Contribution(SOURCE, "life", errors["energy"], how)
    if max(errors.values()) > SAME:
        ours, theirs = max(found, key=lambda pair: relative(pair[0].amplitude, pair[1].amplitude))
        why = (
            f"at this frequency the contact has more than one motion, of amplitudes {ours.amplitude:.3g} and "
            f"{theirs.amplitude:.3g} m, and what was before decides which is made"
        )
        yield from (Contribution(SOURCE, name, None, why) for name in CONCERNED)


def _tops(state: State) -> list[int]:
    """Highest harmonics that motions are looked for with."""
    own = state.balance.basis.harmonics[-1]
    return sorted({own, max(own, RICH)})


def others(state: State, site: AtFrequency | BesidePeak, highest: int) -> Iterator[tuple[Answers, Answers]]:
    """What the motion of a state says with all harmonics to `highest`, beside every one that is arrived at there.

    Where it is lost with so many, the first that is arrived at stands for it
    """
    balance, omega, output = state.balance, state.here.state.omega, site.output
    basis, options = balance.basis, site.newton
    if highest > basis.harmonics[-1]:
        wide = harmonic_choice.widened(balance, highest, harmonic_choice.ROUGH)
        balance = wide.with_harmonics(tuple(h for h in wide.basis.harmonics if h <= highest))
    near = newton.solve(balance, omega, basis.transfer(state.here.state.x, balance.basis), options)
    found = [*([near] if near.converged else []), *arrivals(balance, omega, options)]
    said = [Answers.of(balance, OperatingPoint.of(balance, one, output, 1)) for one in found]
    yield from ((said[0], one) for one in said[1:])

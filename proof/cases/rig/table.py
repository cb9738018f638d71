"""One table of the fretting rig: every published number and trend, and ours."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from proof.cases.rig import published
from proof.cases.rig.cases import READINGS, STUCK_PRELOAD, Stage, Study, solved
from proof.cases.rig.fit import FREQUENCIES
from proof.cases.rig.wear import RigWear
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS

MILLION = 1e6
UPPER_PEAK = (340.0, 450.0)  # where the peak near 400 Hz is looked for [Hz]
EQUAL = 1e-6  # relative difference of numbers that are the same


@dataclass(frozen=True)
class Number:
    """A published number and ours, both in `unit`."""

    topic: str
    name: str
    unit: str
    published: float
    ours: float
    note: str = ""

    @property
    def difference(self) -> float:
        """Ours over published, less one."""
        return self.ours / self.published - 1


@dataclass(frozen=True)
class Trend:
    """What the text says, what ours does, and whether that is the same."""

    topic: str
    published: str
    ours: str
    agrees: bool


@dataclass(frozen=True)
class Check:
    """A stage of wear by harmonic balance and by time integration, as `cases.InTime`; energies [J], preloads [N]."""

    cycles: float
    preload_at_rest: float
    energy: float
    energy_in_time: float | None
    amplitude_difference: float | None
    outcome: str


@dataclass(frozen=True)
class Table:
    """seconds : of processor time of the whole study."""

    numbers: tuple[Number, ...]
    trends: tuple[Trend, ...]
    checks: tuple[Check, ...]
    seconds: float


def table(study: Study) -> Table:
    """Everything compared."""
    numbers = [*_frequencies(study), *_energies(study), *_lives(study)]
    trends = [*_statics(study), *_first_contact(study), *_evolution(study), *_responses(study.stages, study)]
    return Table(tuple(numbers), tuple(trends), tuple(_check(study.runs[0], s) for s in study.stages), study.seconds)


def _check(run: RigWear, stage: Stage) -> Check:
    time = stage.in_time
    cycles, remainder = float(run.history.cycles[stage.row]), float(run.rest[stage.row])
    return Check(cycles, remainder, stage.cycle.energy, time.energy, time.amplitude, time.outcome)


def _frequencies(study: Study) -> list[Number]:
    numbers = [
        Number("frequency", measured.name, "Hz", measured.value, float(after), f"rigid joints: {before:.0f}")
        for measured, before, after in zip(FREQUENCIES, study.before, study.after, strict=True)
    ]
    complex_ = Number(
        "frequency", "stuck, complex", "Hz", published.STUCK_COMPLEX, study.stuck_complex, "nearest of ours, not fitted"
    )
    return [*numbers, complex_]


def _energies(study: Study) -> list[Number]:
    all_, fewer = (study.cycles[saved] for saved in READINGS)
    numbers = []
    for force, (energy, range_) in published.TABLE_5_3.items():
        cycle, other = all_[force], fewer[force]
        name = f"{force:.0f} N at 290 Hz"
        note = f"harmonics 0 to {READINGS[1][-1]}: "
        numbers += [
            Number("energy per cycle", name, "uJ", 1e6 * energy, 1e6 * cycle.energy, f"{note}{1e6 * other.energy:.3g}"),
            Number("sliding range", name, "um", 1e6 * range_, 2e6 * cycle.slip, f"{note}{2e6 * other.slip:.3g}"),
        ]
    return numbers


def _lives(study: Study) -> list[Number]:
    first = study.runs[0]
    numbers = [
        Number("preload", "at the start", "N", published.PRELOAD, float(first.rest[0]), "platform height fitted to it")
    ]
    remaining = f", harmonics 0 to {READINGS[1][-1]}"
    for run, reading in (*((run, "") for run in study.runs), (study.other, remaining)):
        name = f"mating height {1e6 * run.shift:+.0f} um{reading}"
        end = "to loss of preload" if run.lost else f"so far ({run.end})"
        start = f"{run.rest[0]:.1f} N at the start"
        numbers += [
            Number("life", f"{name}, {end}", "10^6 cycles", published.LIFE_MEASURED / MILLION,
                   float(run.history.cycles[-1]) / MILLION,
                   f"published simulations: about {published.LIFE_SIMULATED / MILLION:.0f}; {start}"),
            Number("friction work", f"{name}, {end}", "J", published.WORK, float(run.spent[-1])),
        ]  # fmt: skip
    numbers += [
        Number("wear", "worn part of the face", "-", published.WORN_AREA, float(first.worn_share[-1])),
        Number("wear", "slope of volume over work", "um3/J", 1e18 * published.WEAR_COEFFICIENT, 1e18 * first.slope(),
               f"put in: {1e18 * study.coefficient:.4g}"),
        Number("effort", "wear steps", "-", published.WEAR_STEPS, len(first.rest) - 1),
        Number("effort", "time of one simulation", "min", 60 * published.HOURS, first.seconds / 60,
               "ours: processor time, one thread"),
    ]  # fmt: skip
    return numbers


def _statics(study: Study) -> list[Trend]:
    none = study.heights[0]
    worst = max(abs(h.reaction - h.preload) / h.preload for h in study.heights[1:])
    tight = 2e6 * study.tight.slip
    slips = {force: _sliding_share(cycle.state.cycle.status) for force, cycle in study.cycles[READINGS[0]].items()}
    shares = ", ".join(f"{force:.0f} N {share:.0%}" for force, share in slips.items())
    return [
        Trend("prescribed height", "the reaction at the platform is the preload", f"to {worst:.1e}", worst < EQUAL),
        Trend("prescribed height", "no interference, no preload", f"{none.preload:.1e} N, screws {none.reaction:.1e} N",
              abs(none.preload) + abs(none.reaction) < EQUAL),
        Trend("prescribed height", "without contact the response is the open one",
              f"to {study.apart:.1e} (linear reference of {len(study.references.omega)} points)", study.apart < 1e-3),
        Trend("stuck", f"no relative displacement over {STUCK_PRELOAD:.0f} N of preload",
              f"range {tight:.2g} um at 70 N of shaker force, all of it elastic" if _sliding_share(
                  study.tight.state.cycle.status) == 0 else f"range {tight:.2g} um at 70 N of shaker force",
              tight < 1.0),
        Trend("sliding", "stick and micro-slip below 50 N, stick and full slip from 50 N on",
              f"pairs in contact that slide: {shares}",
              all((share == 1.0) == (force >= published.FULL_SLIP) for force, share in slips.items())),
    ]  # fmt: skip


def _sliding_share(status: np.ndarray) -> float:
    touching = status != SEPARATES
    return float(np.mean((status[touching] & SLIPS) > 0)) if touching.any() else 1.0


def _first_contact(study: Study) -> list[Trend]:
    run = study.runs[0]
    force, path = run.history.normal_force[0], run.points[:, 0]
    inner, outer = (force[np.isclose(path, end)].sum() / force.sum() for end in (path.min(), path.max()))
    touching = float((run.history.status[0] != SEPARATES) @ run.area / run.area.sum())
    return [
        Trend("first contact", "at the two ridges along the long edges", f"{inner + outer:.0%} of the normal force",
              bool(inner + outer > 0.9)),
        Trend("first contact", "at the inner edge, closest to the column",
              f"inner edge {inner:.0%}, outer edge {outer:.0%} of the normal force", bool(inner > outer)),
        Trend("first contact", "only part of the face", f"{touching:.0%} of it", touching < 0.5),
    ]  # fmt: skip


def _evolution(study: Study) -> list[Trend]:
    first = study.runs[0]
    fast = _fall(first, 0.0, published.FAST_CYCLES)
    slow = _fall(first, published.FAST_CYCLES, published.FAST_CYCLES + published.SLOW_CYCLES)
    residual = first.volume - np.polyval(np.polyfit(first.spent, first.volume, 1), first.spent)
    linear = float(residual.std() / first.volume.std())
    lives = {run.shift: run.history.cycles[-1] for run in study.runs}
    order = [1e6 * shift for shift in sorted(lives, key=lambda shift: lives[shift])]
    falls = bool((np.diff(first.rest) < 1e-3 * first.rest[0]).all())
    heights = [float(np.ptp(stage.friction)) for stage in study.stages]
    energies = 1e6 * first.energy[[stage.row for stage in study.stages]]
    return [
        Trend("preload", "falls all the time", "at rest it does" if falls else "not all the time", falls),
        Trend("preload", "fast over 5 million cycles, then slowly over 10 million",
              f"{fast:.2f}, then {slow:.2f} N per million cycles", bool(fast > 1.5 * slow)),
        Trend("volume", "linear in friction work", f"residual {linear:.1e} of its spread", linear < 1e-2),
        Trend("mating height", "3 um less: shorter life",
              "lives rise in the order " + ", ".join(f"{h:+.0f} um" for h in order), order == sorted(order)),
        Trend("loops", "lower as wear goes on", "height " + ", ".join(f"{h:.0f}" for h in heights) + " N",
              bool(heights[-1] < 0.5 * heights[0])),
        Trend("energy per cycle", "falls with the preload", ", ".join(f"{e:.0f}" for e in energies) + " uJ",
              bool(energies[-1] < 0.5 * energies[0])),
    ]  # fmt: skip


def _fall(run: RigWear, start: float, stop: float) -> float:
    """Fall of the preload at rest [N] per million cycles, up to the end of the run."""
    stop = min(stop, float(run.history.cycles[-1]))
    current, refined = run.at_cycles(np.array([start, stop]), run.rest)
    return float((current - refined) / max((stop - start) / MILLION, 1e-9))


def upper_peak(stage: Stage) -> tuple[float, float] | None:
    """Frequency [Hz] and amplitude [m] of the highest interior maximum near 400 Hz; None where there is none."""
    good = solved(stage.response)
    hertz, height = stage.response.frequency[good], stage.response.amplitude("response")[good]
    inside = np.flatnonzero((hertz[1:-1] > UPPER_PEAK[0]) & (hertz[1:-1] < UPPER_PEAK[1])) + 1
    peaks = [i for i in inside if height[i] > height[i - 1] and height[i] >= height[i + 1]]
    if not peaks:
        return None
    best = max(peaks, key=lambda i: height[i])
    return float(hertz[best]), float(height[best])


def _responses(stages: Sequence[Stage], study: Study) -> list[Trend]:
    peaks = [upper_peak(stage) for stage in stages]
    text = ", ".join("none" if peak is None else f"{peak[0]:.0f}" for peak in peaks)
    rows = [peak[0] for peak in peaks if peak is not None]
    last = stages[-1]
    good = solved(last.response)
    hertz, height = last.response.frequency[good], last.response.amplitude("response")[good]
    order = np.argsort(hertz)
    free = np.interp(hertz, study.references.omega / (2 * np.pi), study.references.free)
    nearby = float(np.median(np.abs(height / free - 1)))
    top = float(hertz[order][np.argmax(height[order])])
    open_ = float(study.references.omega[np.argmax(study.references.free)] / (2 * np.pi))
    return [
        Trend("response", "the peak near 400 Hz softens with wear", f"{text} Hz at the five stages",
              len(rows) > 1 and bool((np.diff(rows) < 0).all())),
        Trend("response", "ends on the open one",
              f"largest at {top:.0f} Hz (open: {open_:.0f}), half of the points within "
              f"{nearby:.0%} of the open response",
              nearby < 0.1),
    ]  # fmt: skip


def as_text(table: Table) -> str:
    """Markdown."""
    lines = ["| | published | ours | difference | |", "|---|---|---|---|---|"]
    lines += [
        f"| {n.topic}: {n.name}{'' if n.unit == '-' else ', ' + n.unit} | {n.published:.4g} | {n.ours:.4g} "
        f"| {100 * n.difference:+.3g} % | {n.note} |"
        for n in table.numbers
    ]
    lines += ["", "| | published | ours | agrees |", "|---|---|---|---|"]
    lines += [f"| {t.topic} | {t.published} | {t.ours} | {'yes' if t.agrees else 'no'} |" for t in table.trends]
    lines += ["", "| 10^6 cycles | preload at rest, N | energy, uJ | in time, uJ | amplitude | time integration |"]
    lines += ["|---|---|---|---|---|---|"]
    for c in table.checks:
        energy = "-" if c.energy_in_time is None else f"{1e6 * c.energy_in_time:.0f}"
        amplitude = "-" if c.amplitude_difference is None else f"{100 * c.amplitude_difference:+.2g} %"
        lines.append(
            f"| {c.cycles / MILLION:.3g} | {c.preload_at_rest:.1f} | {1e6 * c.energy:.0f} | {energy} | {amplitude} "
            f"| {c.outcome} |"
        )
    lines += ["", f"{table.seconds:.0f} s of processor time, one thread"]
    return "\n".join(lines) + "\n"

"""A mistuned wheel: sectors whose stiffnesses deviate, what cyclic symmetry of one sector cannot say.

The same reduced sector as for a travelling wave, once for every sector and each with its own stiffness, joined at the
contacts to one real model of the whole wheel. Memory and time grow with the number of sectors."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Annotated

import numpy as np

from tribodyn.fem.cyclic_symmetry import sector_maps
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.hbm.threads import limited
from tribodyn.reduction.linear_damping import modal_damping_towards
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of, length_unit
from tribodyn.workflows.pictures.matplotlib_names import Figure, mpl
from tribodyn.workflows.pictures.theme import INK, WEAR_MAP
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.fields import Number, quantity
from tribodyn.workflows.scene.scene_file import Overrides, Source, read_scene
from tribodyn.workflows.studies.derivatives_at_points import of_branch
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.response_derivatives import ResponseDerivatives
from tribodyn.workflows.studies.study_result import StudyResult
from tribodyn.workflows.studies.wheels import wheel_model as wheels

TOLERANCE = 3e-3  # of the curves between their points


@dataclass(frozen=True, repr=False)
class MistunedSectors(StudyResult):
    """Responses of a wheel, and of the same wheel with all sectors alike.

    stiffness : (n_sectors,) factors; heights : (n_point, n_sectors) amplitudes of the wheel at its points [m]
    peak : derivatives of the largest amplitude and its frequency by every factor, or why there are none"""

    stiffness: np.ndarray
    branch: Branch
    heights: np.ndarray
    tuned: Branch
    peak: ResponseDerivatives | NoDerivative

    @property
    def amplification(self) -> float | None:
        """Largest amplitude of any sector over that of sectors alike; None without a peak of both in the range."""
        curves = self.heights.max(axis=1), self.tuned.amplitude(OUTPUT)
        has_peaks = all(0 < curve.argmax() < len(curve) - 1 for curve in curves)
        return float(curves[0].max() / curves[1].max()) if has_peaks else None

    def record(self) -> dict[str, object]:
        worst = int(np.argmax(self.heights.max(axis=0)))
        return {
            "stiffness": self.stiffness.tolist(),
            "amplification": self.amplification,
            "worst_sector": worst,
            "amplitude": float(self.heights.max()),
            "amplitude_alike": float(self.tuned.amplitude(OUTPUT).max()),
            "derivatives": None if isinstance(self.peak, NoDerivative) else self.peak.record(),
        }

    def lines(self) -> list[str]:
        ratio = self.amplification
        lines = [
            "factors on the stiffness: " + ", ".join(f"{factor:.4f}" for factor in self.stiffness),
            "largest amplitude over that of sectors alike: "
            + ("not known, a response is highest at an end of its range" if ratio is None else f"{ratio:.3f}"),
        ]
        if isinstance(self.peak, NoDerivative):
            return [*lines, f"it has no derivatives by the factors: {self.peak}"]
        row, lines = self.peak.derivatives.names.index("amplitude"), [*lines, *self.peak.lines()]
        norm = np.linalg.norm([elasticity[row] for elasticity in self.peak.elasticities.values()])
        lines.append(f"to first order a scatter of 0.1 % of all factors scatters the amplitude by {0.1 * norm:.3g} %")
        tall = self.heights.max(axis=0)
        if (tall > (1 - TOLERANCE) * tall.max()).sum() > 1:
            lines.append("warning: another sector is as high, to which the largest amplitude may pass: a corner")
        return lines

    def write(self, folder: Path) -> list[Path]:
        """Write mistuned.csv, the amplitude of every sector over frequency, mistuned.png, and those of its peak."""
        heights = {f"sector_{n}_m": column for n, column in enumerate(self.heights.T)}
        columns = {"frequency_Hz": self.branch.frequency, **heights}
        written = write_files(folder, {"mistuned": columns}, lambda: {"mistuned": self.plot()})
        return written if isinstance(self.peak, NoDerivative) else [*written, *self.peak.write(folder)]

    def plot(self) -> Figure:
        """Amplitude of every sector over frequency, beside that of sectors alike."""
        colours = mpl.colormaps[WEAR_MAP](np.linspace(0.0, 0.92, len(self.stiffness)))
        with axes_of(7.6, 4.6) as (figure, axes):
            unit, scale = length_unit(float(self.heights.max()))
            for n, colour in enumerate(colours):
                label = f"sector {n}: {100 * (self.stiffness[n] - 1):+.1f} %" if len(colours) <= 12 else None
                axes.plot(self.branch.frequency, scale * self.heights[:, n], color=colour, label=label)
            tuned = scale * self.tuned.amplitude(OUTPUT)
            axes.plot(self.tuned.frequency, tuned, "--", color=INK, label="sectors alike")
            axes.set(yscale="log", xlabel="frequency / Hz", ylabel=f"amplitude / {unit}")
            axes.set_title("Sectors whose stiffnesses deviate")
            axes.legend(ncols=2)
        return figure


def deviations(n_sectors: int, spread: float, seed: int) -> np.ndarray:
    """Factors (n_sectors,) on the stiffness, drawn from a normal distribution, then shifted and scaled.

    Their mean is one and their standard deviation is `spread`, exactly; the same seed gives the same factors.
    Raises  Refusal for a spread that makes a factor zero or less"""
    drawn = np.random.default_rng(seed).normal(size=n_sectors)
    drawn -= drawn.mean()
    return checked(1 + spread * drawn / drawn.std(), n_sectors)


def checked(factors: Sequence[float] | np.ndarray, n_sectors: int) -> np.ndarray:
    """Factors as an array; raises Refusal where there is not one above zero for each sector."""
    values = np.asarray(factors, float)
    if values.shape != (n_sectors,):
        raise Refusal(f"the wheel has {n_sectors} sectors, but there are {values.size} factors: give one for each")
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise Refusal("a factor on the stiffness of a sector must be a number above 0")
    return values


def stiffer(wheel: wheels.Wheel, balance: HarmonicBalance) -> Iterator[ParameterChange]:
    """What the factor on the elastic stiffness of every sector does to the balance of a whole wheel, which is linear.

    Raises  NoDerivative for Rayleigh's damping of two modes, which may be a pair of the wheel that parts"""
    base, model, damping = BalanceInputs.of(balance), balance.model, wheel.scene.damping
    if damping.ratios is not None:
        raise NoDerivative("damping.ratios goes by two modes of the wheel: give damping.modal, or mass and stiffness")
    if isinstance(damping.modal, tuple):
        raise NoDerivative("damping.modal has a ratio for each mode of the wheel: give one for all")
    of_modes = None if damping.modal is None else modal_damping_towards(model.system, damping.modal)
    elastic = wheel.elastic
    for n, P in enumerate(sector_maps(wheel.reduced.sector)):
        change = P.T @ (elastic @ P)
        changed = replace(model.system, stiffness=model.system.stiffness + change)
        if damping.given:
            damped = of_modes(change) if of_modes else (damping.stiffness or 0.0) * change
            changed = replace(changed, damping=model.system.damping + damped)
        # from here to there is a step of one half to both sides of their middle
        yield ParameterChange(
            f"stiffness of sector {n}", 0.5, replace(base, model=replace(model, system=changed)), base, ()
        )


def mistuned(
    scene: Source,
    stiffness: Annotated[Sequence[float] | None, quantity("")] = None,
    *,
    spread: Number = 0.02,
    seed: int = 1,
    overrides: Overrides = (),
) -> MistunedSectors:
    """Solve all sectors of a wheel at once, their stiffnesses a little apart, beside sectors alike.

    scene : name of a scene with a [wheel], or a .toml file
    stiffness : factor on the elastic stiffness of every sector, as blades pinged at rest tell, such as "1.02, 0.99, 1";
        the stress of a wheel that turns stays; drawn by default
    spread : standard deviation of the factors that are drawn, such as "2 %"
    seed : seed of the draw; the same seed gives the same factors
    Raises  SceneError for a scene without [wheel], Refusal for factors that cannot be, SolveFailed"""
    file = read_scene(scene, overrides)
    with limited(file.scene.solver.threads):
        wheel = wheels.build(file)
        n = wheel.n_sectors
        factors = deviations(n, spread, seed) if stiffness is None else checked(stiffness, n)
        frequency = file.scene.response.range
        balance, start = wheel.whole_wheel([float(factor) for factor in factors]), process_time()
        branch = wheels.follow(balance, frequency, TOLERANCE)
        heights = np.column_stack([branch.amplitude(f"{OUTPUT}@{i}") for i in range(n)])
        solved, output = process_time(), f"{OUTPUT}@{heights.max(axis=0).argmax()}"
        try:
            rates = of_branch(file.scene, balance, branch, stiffer(wheel, balance), output=output)
            at = dict(zip(rates.parameters, factors.tolist(), strict=True))
            times = solved - start, process_time() - solved
            peak: ResponseDerivatives | NoDerivative = ResponseDerivatives(file.name, rates, at, {}, *times, ())
        except NoDerivative as reason:
            peak = reason
        tuned = wheels.follow(wheel.wave(), frequency, TOLERANCE)
    return MistunedSectors(factors, branch, heights, tuned, peak)

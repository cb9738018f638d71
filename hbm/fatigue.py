"""Stress over a vibration cycle and its margin to high-cycle fatigue.

A cycle of stress is Fourier coefficients (..., 6, n_coeff), the static one among them. Utilisation is the vibration
amplitude over the one that the material endures for ever at the same mean stress: 1 is the limit.
Source  Goodman (1899), Gerber (1874) and Soderberg (1930) after Dowling, Mechanical Behavior of Materials, 2013,
    sections 9.7 and 9.8; Crossland, Proc. Int. Conf. on Fatigue of Metals, 1956, 138"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis

if TYPE_CHECKING:
    from tribodyn.hbm.balance import HarmonicBalance, State
    from tribodyn.reduction.omitted_modes import OmittedModes


@dataclass(frozen=True)
class Strength:
    """What a material endures.

    endurance_limit : amplitude of reversed stress that is endured for ever, surface and size taken into account [Pa]
    strength : tensile strength [Pa]; yield_strength : [Pa], None where it is not known
    diagram : "goodman", "gerber", "soderberg", or points (mean, amplitude) [Pa] of a Haigh diagram, by rising mean
    torsion_limit : amplitude of reversed shear that is endured, for the criterion of Crossland [Pa]; None for the
        diagram with the equivalent amplitude and mean
    knee, exponent : of the S-N line, cycles = knee * utilisation ** -exponent; None where it is not known
    temperatures : points (change [K], share of all limits and strengths that is left there), by rising change"""

    endurance_limit: float
    strength: float
    yield_strength: float | None = None
    diagram: str | Sequence[Sequence[float]] = "goodman"
    torsion_limit: float | None = None
    knee: float | None = None
    exponent: float | None = None
    temperatures: Sequence[Sequence[float]] = ()

    def share(self, change: np.ndarray | None) -> np.ndarray:
        """Share (...) of all limits and strengths that is left at a change of temperature (...) [K], None for none."""
        if change is None or not len(self.temperatures):
            return np.ones(() if change is None else np.shape(change))
        return np.interp(change, *np.asarray(self.temperatures, float).T)

    def permissible(self, mean: np.ndarray) -> np.ndarray:
        """Amplitude [Pa] that is endured at a mean stress (...) [Pa]; zero beyond the strength. Compression counts as
        no mean, but in a diagram of points, which may go on there."""
        if not isinstance(self.diagram, str):
            table = np.asarray(self.diagram, float)
            return np.interp(mean, table[:, 0], table[:, 1], right=0.0)
        end = self.yield_strength if self.diagram == "soderberg" else self.strength
        share = 1 - (np.maximum(mean, 0.0) / (end or np.nan)) ** (2 if self.diagram == "gerber" else 1)
        return self.endurance_limit * np.maximum(share, 0.0)

    def damage(self, utilisation: np.ndarray) -> np.ndarray:
        """Share of the life (...) that a cycle takes, none up to the limit; nan where the S-N line is not known."""
        knee, exponent = (np.nan if number is None else number for number in (self.knee, self.exponent))
        return np.where(utilisation > 1, np.maximum(utilisation, 1.0) ** exponent / knee, 0.0)


@dataclass(frozen=True)
class PlaceFatigue:
    """Fatigue of a place over a wear run.

    cycles : (n_row,) passed; utilisation : (n_row, n_duty), straight from row to row
    shares : (n_duty,) of the cycles"""

    strength: Strength
    cycles: np.ndarray
    utilisation: np.ndarray
    shares: np.ndarray

    def miner_sum(self, pieces: int = 64) -> tuple[np.ndarray, np.ndarray]:
        """Cycles (n,) and Miner's sum up to them (n,) [-], at which 1 is a crack; nan without an S-N line.

        pieces : of the way from row to row; where a duty passes its limit within, its damage begins within a piece
        Source  Miner, J. Applied Mechanics 12 (1945) A159"""
        rows = np.arange(len(self.cycles))
        at = np.linspace(0, rows[-1], 1 + pieces * rows[-1])
        middle = (at[1:] + at[:-1]) / 2
        use = np.column_stack([np.interp(middle, rows, column) for column in self.utilisation.T])
        cycles = np.interp(at, rows, self.cycles)
        return cycles, np.append(0.0, np.cumsum(np.diff(cycles) * (self.strength.damage(use) @ self.shares)))

    @property
    def life(self) -> float | None:
        """Cycles until Miner's sum is 1, or without an S-N line until a duty reaches its limit; None for neither."""
        cycles, course = self.miner_sum() if self.strength.knee else (self.cycles, self.utilisation.max(axis=1))
        beyond = np.flatnonzero(course >= 1)
        if not len(beyond):
            return None
        after = int(beyond[0])
        pair = slice(max(after - 1, 0), after + 1)
        return float(np.interp(1.0, course[pair], cycles[pair]))


@dataclass(frozen=True)
class StressPlace:
    """A place of a part whose stress is observed as six outputs, one after the other in the order of the components.

    first : row of the first output; held_back : (6,) stress of the heated part without displacement [Pa]
    strength : of the material there, None where the scene gives none; weakening : share of it that heat leaves"""

    name: str
    first: int
    held_back: tuple[float, ...] = (0.0,) * 6
    strength: Strength | None = None
    weakening: float = 1.0

    @property
    def rows(self) -> slice:
        """Its outputs."""
        return slice(self.first, self.first + 6)

    def stress(self, response: np.ndarray, basis: HarmonicBasis) -> np.ndarray:
        """Coefficients (..., 6, n_coeff) [Pa] from the responses of all outputs (..., n_output, n_coeff)."""
        coefficients = np.array(response[..., self.rows, :])
        if basis.has_static:
            coefficients[..., 0] += self.held_back
        return coefficients

    def utilisation(self, stress: np.ndarray, basis: HarmonicBasis) -> np.ndarray:
        """Utilisation (...) in cycles of stress (..., 6, n_coeff) [Pa] there; a strength must be known."""
        assert self.strength is not None
        return utilisation(stress / self.weakening, basis, self.strength)

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> StressPlace:
        """The place of a table that `dataclasses.asdict` made."""
        strength = table.get("strength")
        held_back = tuple(table["held_back"])
        if strength is not None:
            strength = Strength(**strength | {"temperatures": tuple(map(tuple, strength["temperatures"]))})
        return cls(table["name"], table["first"], held_back, strength, table["weakening"])


@dataclass(frozen=True)
class StressOverCycle:
    """Stress of all nodes in a vibration cycle, the largest where materials of a body meet.

    largest : (n_node,) of von Mises [Pa]; utilisation : (n_node,) nan where the strength is not known
    mean, amplitude : (n_node,) equivalent ones at the largest utilisation [Pa], nan likewise
    tensor : (n_node, 2, 6) mean over the cycle, and at the instant of the largest stress of von Mises [Pa]
    tension, watson : (n_pair,) `face_indicators`, the larger of both faces; face_node : (n_pair,) that it is of"""

    largest: np.ndarray
    utilisation: np.ndarray
    mean: np.ndarray
    amplitude: np.ndarray
    tensor: np.ndarray
    tension: np.ndarray
    watson: np.ndarray
    face_node: np.ndarray


class StressField(Protocol):
    """Computes the stress of a whole part; kinds : (n_node,) what stands at each node, of fem.singularities.KINDS.

    omitted : what the modes left out carry, None where that is not known; is_searched : whether the largest of the
    part is asked for; over_cycle : that of a vibration, u (n_node, 3, n_coeff) [m]; of_state : that of a solved state
    singularity : point of a node or a named place, and what makes the exact stress infinite there; "" for nothing"""

    @property
    def is_searched(self) -> bool: ...
    @property
    def kinds(self) -> np.ndarray: ...
    @property
    def omitted(self) -> OmittedModes | None: ...
    def over_cycle(self, u: np.ndarray, basis: HarmonicBasis) -> StressOverCycle: ...
    def of_state(self, balance: HarmonicBalance, state: State) -> StressOverCycle: ...
    def singularity(self, where: int | str) -> str: ...


def over_cycle(coefficients: np.ndarray, basis: HarmonicBasis, samples: int = 256) -> np.ndarray:
    """Stress (..., samples, 6) [Pa] at equal instants of a cycle, from coefficients (..., 6, n_coeff).

    With 256 the largest of a stress that swings in harmonic h is off by less than 8e-5 h^2 of the swing"""
    phase = 2 * np.pi * np.arange(samples) / samples
    return np.swapaxes(coefficients @ basis.functions(phase).T, -1, -2)


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Equivalent stress (...) [Pa] of stress (..., 6) by von Mises (1913), components as in fem.stress.COMPONENTS."""
    xx, yy, zz, yz, xz, xy = np.moveaxis(np.asarray(stress), -1, 0)
    normal = ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2
    return np.sqrt(normal + 3 * (yz**2 + xz**2 + xy**2))


def largest_von_mises(coefficients: np.ndarray, basis: HarmonicBasis, samples: int = 256) -> np.ndarray:
    """Largest stress of von Mises in a cycle (...) [Pa]."""
    return np.asarray(von_mises(over_cycle(coefficients, basis, samples)).max(axis=-1))


def equivalent_amplitude(coefficients: np.ndarray, basis: HarmonicBasis, samples: int = 256) -> np.ndarray:
    """Amplitude (...) [Pa] of multiaxial stress: half the largest stress of von Mises between two instants of a cycle.

    Under proportional loads it is the octahedral shear amplitude as a stress in tension. The stress of von Mises with a
    sign does not serve: in reversed torsion its sign is arbitrary and halves the amplitude"""
    stress = over_cycle(coefficients, basis, samples)
    normal = (stress[..., :3] - stress[..., :3].mean(axis=-1, keepdims=True)) * np.sqrt(1.5)
    # whose length is the stress of von Mises
    deviator = np.concatenate([normal, stress[..., 3:] * np.sqrt(3)], axis=-1)
    squares = (deviator**2).sum(axis=-1)
    products = deviator @ np.swapaxes(deviator, -1, -2)
    largest = (squares[..., :, None] + squares[..., None, :] - 2 * products).max(axis=(-1, -2))
    return np.asarray(np.sqrt(np.maximum(largest, 0.0)) / 2)


def equivalent_mean(coefficients: np.ndarray, basis: HarmonicBasis, samples: int = 256) -> np.ndarray:
    """Mean (...) [Pa] of multiaxial stress: the middle of the sum of its normal stresses over a cycle."""
    total = over_cycle(coefficients, basis, samples)[..., :3].sum(axis=-1)
    return np.asarray((total.max(axis=-1) + total.min(axis=-1)) / 2)


def haigh_point(coefficients: np.ndarray, basis: HarmonicBasis, samples: int = 256) -> tuple[np.ndarray, np.ndarray]:
    """Equivalent mean and amplitude (...) [Pa]."""
    return equivalent_mean(coefficients, basis, samples), equivalent_amplitude(coefficients, basis, samples)


def face_indicators(
    coefficients: np.ndarray, frame: np.ndarray, compliance: np.ndarray, basis: HarmonicBasis, planes: int = 72
) -> np.ndarray:
    """Largest tension in a cycle along a face, and the number of Smith, Watson and Topper: (2, n) [Pa].

    Of all planes that stand on the face the latter is the largest product of the largest tension across one and half
    the range of strain across it
    coefficients : (n, 6, n_coeff) stress [Pa]; frame : (n, 3, 3) rows t1, t2 along the face and its normal
    compliance : (n, 6, 6) strains xx, yy, zz, 2yz, 2xz, 2xy of stresses [1/Pa]
    Source  Smith, Watson and Topper, J. Materials 5 (1970) 767; planes: Szolwinski and Farris, Wear 198 (1996) 93"""
    angle = np.pi * np.arange(planes) / planes
    directions = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ frame[:, :2]
    products = directions[..., [0, 1, 2, 1, 0, 0]] * directions[..., [0, 1, 2, 2, 2, 1]]
    stress = np.swapaxes(over_cycle(coefficients, basis, samples=64), -1, -2)
    strain = products @ compliance @ stress
    tension = np.maximum(products * [1, 1, 1, 2, 2, 2] @ stress, 0.0).max(axis=-1)
    return np.stack([tension.max(axis=-1), (tension * np.ptp(strain, axis=-1) / 2).max(axis=-1)])


def utilisation(
    coefficients: np.ndarray,
    basis: HarmonicBasis,
    strength: Strength,
    samples: int = 256,
    point: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Vibration amplitude over the one that is endured (...); infinite where the mean alone is beyond the strength.

    point : equivalent mean and amplitude (...) [Pa] where these are known"""
    mean, amplitude = haigh_point(coefficients, basis, samples) if point is None else point
    torsion = strength.torsion_limit
    if torsion is not None:  # Crossland: amplitude of the root of J2, and the largest hydrostatic stress
        pressure = over_cycle(coefficients, basis, samples)[..., :3].sum(axis=-1).max(axis=-1) / 3
        slope = 3 * torsion / strength.endurance_limit - np.sqrt(3)
        return np.asarray((amplitude / np.sqrt(3) + slope * pressure) / torsion)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(amplitude > 0, amplitude / strength.permissible(mean), 0.0)

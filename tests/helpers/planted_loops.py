"""Planted loops: series of a friction test from our own contact laws, with noise, drift, delay and a soft fixture.

`python -m tests.helpers.planted_loops 25` counts how many of 25 draws of each law lie within their intervals."""

import csv
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import tribodyn as td
from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

LAWS = ("jenkins", "coulomb_planar", "rough", "iwan")
FACE = np.stack([np.linspace(0, 6e-6, 61), 1e16 * np.exp(-0.5 * ((np.linspace(0, 6e-6, 61) - 4e-6) / 1.2e-6) ** 2)], 1)


@dataclass(frozen=True)
class PlantedLoop:
    """One period of a contact, (n,), and its numbers by name."""

    displacement: np.ndarray
    tangential: np.ndarray
    normal: np.ndarray
    truth: dict[str, float]

    @classmethod
    def of(cls, law: str, rng: np.random.Generator) -> "PlantedLoop":
        """A law with numbers drawn at random."""
        friction, preload, swing = rng.uniform(0.3, 1.0), rng.uniform(20, 60), rng.uniform(0, 0.3)
        k_n, k_t, n = rng.uniform(20e6, 40e6), rng.uniform(10e6, 40e6), 1
        name, components, numbers = law, ("t1", "n"), {"friction": friction}
        share = limit = np.ones(1)
        if law == "coulomb_planar":
            components = ("t1", "t2", "n")
        if law == "rough":
            numbers |= {"young": 2e11, "poisson": 0.3, "radius": 3e-5, "area": 5e-8}
        elif law == "iwan":  # sliders of one stiffness whose limits are spread evenly from 0 to twice their mean
            n, name = 40, "jenkins"
            share, limit = np.full(n, 1 / n), (np.arange(n) + 0.5) / n * 2
        springs = np.array(
            [[k_t * s if c != "n" else k_n * s * v for c in components] for s, v in zip(share, limit, strict=True)]
        )
        numbers |= {"table": FACE} if law == "rough" else {}
        parameters = contact_law.complete(name, ContactParameters.of(components, springs, **numbers))
        x = np.zeros((n, len(components), 5))
        x[:, -1, 0] = preload / k_n if law != "rough" else rng.uniform(1.5e-6, 2.5e-6)
        x[:, -1, 1:3] = swing * x[:, -1, :1] * np.array([0.6, 0.8]) * (law != "rough")
        module, basis = contact_law.load(name), HarmonicBasis((0, 1, 2), 8192)
        memory = module.memory_at_rest(x[..., 0], parameters) if law == "rough" else None
        if law == "rough":
            preload = float(aft.history(module, x, parameters, basis, memory)[1][0, -1, 0])
            numbers["pressure"] = preload / numbers["area"]
            parameters = contact_law.complete(name, ContactParameters.of(components, springs, **numbers))
            k_t = float(module.springs(parameters)[0, 0])
        amplitude = friction * preload / k_t * rng.uniform(4, 15)
        x[:, 0, 1], x[:, 0, 3] = amplitude, 0.05 * amplitude
        if law == "coulomb_planar":
            x[:, 1, 2] = 0.01 * amplitude  # across, a quarter of a cycle later
        u, force = aft.history(module, x, parameters, basis, memory)
        u1, tangential, normal = u[0, 0], *force[:, [0, -1]].sum(axis=0)
        truth = {
            "friction": friction, "stiffness": k_t, "preload": float(normal.mean()),
            "energy": float((tangential + np.roll(tangential, -1)) @ (np.roll(u1, -1) - u1) / 2),
        }  # fmt: skip
        return cls(u1, tangential, normal, truth)

    def write(self, path: Path, rng: np.random.Generator) -> dict:
        """Write what a rig with an L-shaped separator would measure; the options that `loops` takes with it."""
        f, delay, soft = rng.uniform(20, 300), rng.uniform(-2e-3, 6e-3), rng.uniform(0, 8e-9)
        noise = rng.uniform(1e-3, 1e-2)
        n_per_cycle, n_cycle = rng.uniform(40, 80), rng.integers(30, 60)
        turns = np.arange(int(n_per_cycle * n_cycle)) / n_per_cycle + rng.uniform()
        u, force, normal = ([*values, values[0]] for values in (self.displacement, self.tangential, self.normal))
        x, late_force, late_normal = (
            np.interp((turns - late) % 1 * 8192, np.arange(8193), values)
            for values, late in ((np.array(u) + soft * np.array(force), 0), (force, delay), (normal, delay))
        )
        size, share = np.abs(force).max(), np.linspace(0, 1, len(turns))
        x = x + np.ptp(u) * (noise / 5 * rng.standard_normal(len(turns)) + 0.1 * rng.standard_normal() * share)
        late_force = late_force + size * (noise * rng.standard_normal(len(turns)) + 0.2 * share**2)
        first = rng.normal(scale=2)
        late_normal = late_normal + noise * size * rng.standard_normal(len(turns)) + first + rng.normal(scale=2) * share
        rows = np.stack([turns / f, 1e6 * x, (late_normal + late_force) / 20, (late_normal - late_force) / 25], axis=1)
        with path.open("w", newline="") as stream:
            csv.writer(stream).writerows([["time [s]", "x_um", "U1 [V]", "U2 [V]"], *rows.tolist()])
        error, mean = 0.05, self.truth["preload"]
        return {
            "displacement": "x", "tangential": "10 N*U1 - 12.5 N*U2", "normal": "10 N*U1 + 12.5 N*U2",
            "compliance": soft * rng.normal(loc=1, scale=error), "compliance_error": error, "reading": (mean, mean),
        }  # fmt: skip


def evaluation(law: str, seed: int, folder: Path) -> tuple[dict[str, float], td.studies.MeasuredLoops]:
    """Numbers of a planted loop, and what `study loops` finds."""
    rng = np.random.default_rng([LAWS.index(law), seed])
    planted = PlantedLoop.of(law, rng)
    return planted.truth, td.studies.loops(folder / "rig.csv", **planted.write(folder / "rig.csv", rng))


def main(count: int) -> None:
    """Print for each law and number how many draws lie within the interval, median error and median half width."""
    with tempfile.TemporaryDirectory() as folder:
        for law in LAWS:
            draws = [evaluation(law, seed, Path(folder)) for seed in range(count)]
            for name in draws[0][0]:
                pairs = [(truth[name], result.governing.intervals[name]) for truth, result in draws]
                error, half = np.array([(i.value / value - 1, i.half / value) for value, i in pairs]).T
                inside, shown = (np.abs(error) <= half).sum(), f"{np.median(np.abs(error)):.2%} {np.median(half):.2%}"
                print(f"{law:15} {name:10} {inside:4d} of {count} {shown}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]))

"""Documented fits of the fretting rig: run with python -m workflows.rig_fit [--set key=value ...].

1. Joint springs to the published open and stuck frequencies. The thesis relaxed the same joints, by how much it does not
   say. Springs that act at one joint are tied where the frequencies cannot tell them apart.
2. Platform height to the published preload of 31 N, for the faces of the scene.
3. Modal damping to the energies of table 5.3, all five forces at 290 Hz.
4. Wear coefficient to the published life: life times coefficient is a constant of the energy law, so that one wear run
   tells it. The published coefficient, measured as slope of volume over energy, stays in the scene.
What is found stands in scenes/rig.toml, marked "fit".
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from workflows import scene_file
from workflows.identification import Identification, Measured, Parameter, fit
from workflows.rig_joints import OPEN, STUCK, Joints, joints_of
from workflows.rig_model import Rig
from workflows.scene_file import SceneFile

TIED = {
    "base_vertical": ("base_vertical",),
    "base_sliding": ("base_along", "base_across"),
    "seat": ("seat_along", "seat_across", "seat_vertical"),
}
RIGID = 1e11  # stiffness beyond which no published frequency changes by one in a thousand [N/m]
PRELOAD = 31.0  # published [N]
TABLE_5_3 = {10.0: (1.5e-6, 0.2e-6), 20.0: (20e-6, 2e-6), 40.0: (150e-6, 5e-6), 50.0: (450e-6, 12e-6), 70.0: (1.4e-3, 50e-6)}
"""Published: shaker force [N] -> energy per cycle [J], relative displacement [m], at 290 Hz and 31 N."""


def stiffnesses(values: Mapping[str, float]) -> dict[str, float]:
    """Stiffness of each spring of the scene from the tied ones [N/m]."""
    return {name: values[tied] for tied, names in TIED.items() for name in names}


def rigid() -> dict[str, float]:
    """Joints that do not give way, as the model is before the fit."""
    return stiffnesses(dict.fromkeys(TIED, RIGID))


def fit_joints(joints: Joints) -> Identification:
    """Joint springs to the published frequencies; "before" is the rig with rigid joints."""
    starts = {"base_vertical": (RIGID, 1e9), "base_sliding": (RIGID, 1e9), "seat": (RIGID,)}
    parameters = [Parameter(name, 1e8, RIGID, starts[name], "N/m") for name in TIED]
    modes = [(state, *mode) for state, modes in (("open", OPEN), ("stuck", STUCK)) for mode in modes]
    measured = [Measured(f"{state}, {kind}", value, "Hz") for state, kind, value in modes]
    return fit(parameters, measured, lambda values: joints.frequencies(stiffnesses(values)))


def fit_height(rig: Rig) -> Identification:
    """Platform height to the published preload."""
    parameter = Parameter("platform", 5e-6, 50e-6, (rig.height,), "m")
    return fit(
        [parameter],
        [Measured("preload", PRELOAD, "N")],
        lambda values: np.array([rig.with_height(values["platform"]).at_rest().preload]),
    )


def fit_damping(rig: Rig) -> Identification:
    """Modal damping to the published energies per cycle."""
    measured = [Measured(f"energy at {force:.0f} N", energy, "J") for force, (energy, _) in TABLE_5_3.items()]

    def energies(values: Mapping[str, float]) -> np.ndarray:
        damped = rig.with_damping(values["modal damping"])
        return np.array([max(damped.with_force(force).cycle().energy, 1e-9) for force in TABLE_5_3])

    return fit([Parameter("modal damping", 0.005, 0.05, (0.01, 0.02), "-")], measured, energies)


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit and print the reports."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    overrides = [value for key, value in zip(words[::2], words[1::2], strict=True) if key == "--set"]
    file = scene_file.read("rig", overrides)
    with threadpool_limits(1):
        report(file)


def report(file: SceneFile) -> None:
    """Print every fit."""
    joints = joints_of(file)
    found = fit_joints(joints)
    springs = stiffnesses(found.named())
    print("Joint springs to published frequencies\n" + found.report())
    for name, chosen in (("rigid joints", rigid()), ("fitted joints", springs)):
        print(f"{name}: {joints.normal_stiffness(chosen, 'nut') * 1e-6:.3g} N/um of preload per platform height")
    rig = Rig.of(file)
    print("\nPlatform height to the preload, with the springs of the scene\n" + fit_height(rig).report())
    print("\nModal damping to the energies of table 5.3\n" + fit_damping(rig).report())


if __name__ == "__main__":
    main()

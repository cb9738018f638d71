"""The motion that a scene gives to the ground behind a contact."""

import numpy as np

from tribodyn.fem.interface import COMPONENTS
from tribodyn.fem.part import Part
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.schema import MeshScene


def ground_motion(scene: MeshScene, part: Part, basis: HarmonicBasis) -> np.ndarray | None:
    """Motion of the ground (n_pair * n_component, n_coeff) [m] along the contact components, None where it rests.

    Raises  Refusal where a face has no contact or a harmonic is not kept"""
    if not scene.motion:
        return None
    i = part.interface
    amplitudes = np.zeros((i.n_pair, len(i.components), len(basis.harmonics)), complex)
    for face, motion in scene.motion.items():
        if face not in part.pairs:
            raise Refusal(f'motion.{face}: "{face}" is no contact face, the contact has {", ".join(part.pairs)}')
        rows = i.frames[part.pairs[face]][:, [COMPONENTS.index(c) for c in i.components]]
        for h, value in ((0, motion.static), (1, motion.harmonic * np.exp(1j * motion.phase))):
            if value != 0 and h not in basis.harmonics:
                raise Refusal(f"motion.{face} moves in harmonic {h}: keep it in harmonics.kept")
            if h in basis.harmonics:
                amplitudes[part.pairs[face], :, basis.harmonics.index(h)] = value * (rows @ np.array(motion.direction))
    return basis.to_real(amplitudes).reshape(-1, basis.n_coeff)

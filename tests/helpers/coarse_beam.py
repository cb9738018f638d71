"""A coarse beam of the thesis as a part, without a scene."""

import numpy as np
import skfem

from tribodyn.fem.constraints import Clamp
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.load_vectors import NodalForce, Pressure
from tribodyn.fem.material import Material
from tribodyn.fem.part import build


def make(nx=8, patch=2, clamped=True):
    """A coarse beam of the thesis with a point load, a pressure and two outputs."""
    x = np.append(np.linspace(0, 0.18, nx + 1), np.linspace(0.18, 0.2, patch + 1)[1:])
    side = np.linspace(0, 0.02, patch + 1)
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(x, side, side)).with_boundaries(
        {"contact": lambda x: (x[2] < 1e-9) & (x[0] > 0.18), "top": lambda x: x[2] > 0.02 - 1e-9}
    )
    p = mesh.doflocs.T
    sets = {
        "root": np.flatnonzero(p[:, 0] < 1e-9),
        "mid": np.array([np.argmin(np.linalg.norm(p - [0.09, 0.01, 0.02], axis=1))]),
        "tip": np.flatnonzero(p[:, 0] > 0.2 - 1e-9),
    }
    return build(
        mesh,
        sets,
        Material(210e9, 0.3, 7860.0),
        [Clamp("root")] if clamped else [],
        [ContactFaces("contact", t1=(1, 0, 0))],
        {"point": NodalForce("mid", (0, 1, -1)), "pressure": Pressure("top")},
        {"mid": NodalForce("mid", (0, 1, 0)), "tip": NodalForce("tip", (0, 0, 1))},
    )

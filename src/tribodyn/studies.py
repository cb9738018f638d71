"""Studies: each is one function whose result has `record()`, `lines()` and, where there are files, `write(folder)`.

A scene is a name, the path of a .toml file, its tables as a dict, or one that was read. The words `tribodyn curve`
and `study` are made from these functions.
"""

from tribodyn.geometry.surface import HeightMap
from tribodyn.workflows.studies.convergence import Converged, converge
from tribodyn.workflows.studies.curves.backbones import SceneBackbone, backbone
from tribodyn.workflows.studies.curves.decay import Decay, ring_down
from tribodyn.workflows.studies.curves.folds import FoldsFound, folds
from tribodyn.workflows.studies.curves.tracking import Track, track
from tribodyn.workflows.studies.derivatives import ResponseDerivatives, derivatives
from tribodyn.workflows.studies.fits.fit_file import Fit, identify, posterior
from tribodyn.workflows.studies.fits.posterior import Posterior
from tribodyn.workflows.studies.forces import Forces, forces
from tribodyn.workflows.studies.inspection import Inspection
from tribodyn.workflows.studies.many.lives import Lives, lives
from tribodyn.workflows.studies.many.optimum import Optimum, optimise
from tribodyn.workflows.studies.many.study import grid
from tribodyn.workflows.studies.many.table import StudyTable
from tribodyn.workflows.studies.measured.compare import Compared, compare
from tribodyn.workflows.studies.supports import Supports, supports
from tribodyn.workflows.studies.surfaces import FaceAsperities, asperities
from tribodyn.workflows.studies.verification import Comparison
from tribodyn.workflows.studies.worn_states import WornStates, verify_states

__all__ = [
    "Compared",
    "Comparison",
    "Converged",
    "Decay",
    "FaceAsperities",
    "Fit",
    "FoldsFound",
    "Forces",
    "HeightMap",
    "Inspection",
    "Lives",
    "Optimum",
    "Posterior",
    "ResponseDerivatives",
    "SceneBackbone",
    "StudyTable",
    "Supports",
    "Track",
    "WornStates",
    "asperities",
    "backbone",
    "compare",
    "converge",
    "derivatives",
    "folds",
    "forces",
    "grid",
    "identify",
    "lives",
    "optimise",
    "posterior",
    "ring_down",
    "supports",
    "track",
    "verify_states",
]

"""Studies: each is one function whose result prints its lines and has `record()` and, with files, `write(folder)`.

A scene is a name, the path of a .toml file, its tables as a dict, or one that was read. The words `tribodyn curve`
and `study` are made from these functions."""

from tribodyn.geometry.height_map import HeightMap as HeightMap
from tribodyn.workflows.studies.convergence import Convergence as Convergence, converge as converge
from tribodyn.workflows.studies.curves.backbones import SceneBackbone as SceneBackbone, backbone as backbone
from tribodyn.workflows.studies.curves.decay import Decay as Decay, ring_down as ring_down
from tribodyn.workflows.studies.fits.scene_fit import Fit as Fit, identify as identify
from tribodyn.workflows.studies.forces import Forces as Forces, forces as forces
from tribodyn.workflows.studies.inspection import Inspection as Inspection
from tribodyn.workflows.studies.many.lives import LifeDistribution as LifeDistribution, lives as lives
from tribodyn.workflows.studies.many.optimum import Optimum as Optimum, optimise as optimise
from tribodyn.workflows.studies.many.study_runs import grid as grid
from tribodyn.workflows.studies.many.study_table import StudyTable as StudyTable
from tribodyn.workflows.studies.measured.compare import (
    MeasurementComparison as MeasurementComparison,
    compare as compare,
)
from tribodyn.workflows.studies.measured.measured_loops import MeasuredLoops as MeasuredLoops, loops as loops
from tribodyn.workflows.studies.measured.wear_test import ReplayedTest as ReplayedTest, replay as replay
from tribodyn.workflows.studies.response_derivatives import (
    ResponseDerivatives as ResponseDerivatives,
    derivatives as derivatives,
)
from tribodyn.workflows.studies.scans.worn_scans import WornScans as WornScans, worn as worn
from tribodyn.workflows.studies.verification import TimeComparison as TimeComparison

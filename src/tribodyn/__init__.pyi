# The names of the front door, each with its home: read by type checkers, and by __init__.py when a name is first used.
from tribodyn import matrices as matrices
from tribodyn import plot as plot
from tribodyn import studies as studies
from tribodyn import wheel as wheel
from tribodyn.hbm.wear.law import Exposure as Exposure
from tribodyn.version import __version__ as __version__
from tribodyn.workflows.result.result import Result as Result
from tribodyn.workflows.result.store import ResultError as ResultError
from tribodyn.workflows.result.store import load as load
from tribodyn.workflows.run.failure import SolveFailed as SolveFailed
from tribodyn.workflows.run.modelling import Model as Model
from tribodyn.workflows.scene.scene_file import SceneError as SceneError
from tribodyn.workflows.scene.scene_file import SceneFile as SceneFile
from tribodyn.workflows.scene.source import read_scene as read_scene
from tribodyn.workflows.studies.inspection import inspect as inspect
from tribodyn.workflows.studies.scenes import build as build
from tribodyn.workflows.studies.scenes import export as export
from tribodyn.workflows.studies.scenes import plan as plan
from tribodyn.workflows.studies.scenes import report as report
from tribodyn.workflows.studies.scenes import run as run
from tribodyn.workflows.studies.scenes import run_to_accuracy as run_to_accuracy
from tribodyn.workflows.studies.scenes import scene_names as scene_names
from tribodyn.workflows.studies.verification import verify as verify

def _show_results_in(shell: object) -> None: ...

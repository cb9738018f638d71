# The names of the front door, each with its home: read by type checkers, and by __init__.py when a name is first used.
from tribodyn import matrices as matrices, plot as plot, studies as studies, wheel as wheel
from tribodyn.hbm.contact.law_check import check_law as check_law
from tribodyn.hbm.wear.law import Exposure as Exposure
from tribodyn.refusal import SolveFailed as SolveFailed
from tribodyn.version import __version__ as __version__
from tribodyn.workflows.result.result import Result as Result
from tribodyn.workflows.result.store import ResultError as ResultError, load as load
from tribodyn.workflows.run.modelling import Model as Model
from tribodyn.workflows.scene.scene_file import (
    SceneError as SceneError,
    SceneFile as SceneFile,
    read_scene as read_scene,
)
from tribodyn.workflows.studies.front_door import (
    build as build,
    export as export,
    plan as plan,
    report as report,
    run as run,
    run_to_accuracy as run_to_accuracy,
    scene_names as scene_names,
)
from tribodyn.workflows.studies.inspection import inspect as inspect
from tribodyn.workflows.studies.verification import verify as verify

def _show_results_in(shell: object) -> None: ...

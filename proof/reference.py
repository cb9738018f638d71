"""A scene that is finer in everything: what its verdict, or an error bound, is held against.

It is not exact: 2.6 times the elements along every edge show 62 % of an error of first order and 85 % of one of second.
"""

from dataclasses import dataclass

from proof.time_limit import TimeUp, processor_seconds
from tribodyn.hbm import threads
from tribodyn.hbm.quantity import names_with_error, of_wear_with_error
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import operating_states, refine
from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile

Values = dict[str, float | None]
MEASURED = "measured"


@dataclass(frozen=True)
class Finer:
    """How much finer a reference is than the scene.

    elements : along every edge; of a scene that was refined to an error bound fewer suffice
    modes : retained ones, or their cutoff; harmonics : beyond the highest, `lowest` at the least; steps : of wear"""

    elements: float = 2.6
    refined_elements: float = 1.75
    modes: float = 3.0
    harmonics: int = 3
    lowest: int = 5
    steps: float = 3.0


FINER = Finer()


def solved(file: SceneFile, seconds: float, elements: float = FINER.elements) -> tuple[Values, str]:
    """What the finer scene answers, and MEASURED or why something is missing.

    Its peak is found by the search that wear runs begin with, which needs no points of a response. Without wear first;
    then with wear, in as many seconds again"""
    fine = finer(file, elements)
    values: Values = dict.fromkeys(names_with_error())
    kind = "its reference"
    try:
        with processor_seconds(seconds), threads.limited(1):
            model = modelling.build(fine, Progress())
            values |= operating_states.unworn_state(fine, model).values
        if fine.scene.wears:
            kind = "measured, the reference of its wear"
            with processor_seconds(seconds), threads.limited(1):
                worn = operating_states.worn_by(fine, model)
            if worn.history.ended.failed:
                raise SolverFailure(str(worn.history.end))
            values |= {quantity.name: quantity.value(worn) for quantity in of_wear_with_error(worn)}
    except TimeUp:
        return values, f"{kind} is too expensive"
    except (Refusal, SolverFailure) as refusal:
        return values, f"{kind} is refused: {refusal}"
    return values, MEASURED


def finer(file: SceneFile, elements: float = FINER.elements) -> SceneFile:
    """The scene with everything finer; elements : along every edge, those of a given mesh are halved."""
    top = max(max(file.scene.harmonics.kept) + FINER.harmonics, FINER.lowest)
    try:
        file = refine.mesh(file, elements)[0]
    except refine.NoMesh:  # harmonics are all that can be finer: as many as the verdict takes in at most
        top = DEFAULT.highest
    file = refine.modes(file, FINER.modes) or file
    file = refine.wear(refine.harmonics(file, range(top + 1)), FINER.steps)
    tolerance, samples = 0.1 * file.scene.solver.tolerance, 2 * file.scene.harmonics.samples
    return file.changed(f"solver.tolerance={tolerance!r}", f"harmonics.samples={samples}")

"""The words `tribodyn study ...`."""

from tribodyn.workflows.command.word import group, word
from tribodyn.workflows.studies.convergence import converge
from tribodyn.workflows.studies.fits.scene_fit import identify
from tribodyn.workflows.studies.forces import forces
from tribodyn.workflows.studies.many.lives import lives
from tribodyn.workflows.studies.many.optimum import optimise
from tribodyn.workflows.studies.many.study_runs import grid
from tribodyn.workflows.studies.measured.compare import compare
from tribodyn.workflows.studies.measured.measured_loops import loops
from tribodyn.workflows.studies.response_derivatives import derivatives
from tribodyn.workflows.studies.scans.worn_scans import worn

app = group(
    "study",
    word(grid, "study grid"),
    word(lives, "study lives"),
    word(optimise, "study optimise"),
    word(identify, "study identify"),
    word(derivatives, "study derivatives"),
    word(converge, "study converge"),
    word(forces, "study forces"),
    word(compare, "study compare"),
    word(loops, "study loops"),
    word(worn, "study worn", into="asked"),
)

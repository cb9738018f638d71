"""The words `tribodyn study ...`."""

from cyclopts import App

from tribodyn.workflows.command.word import word
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
from tribodyn.workflows.studies.surfaces import asperities

app = App(name="study")
app.command(word(grid, "study grid"))
app.command(word(lives, "study lives"))
app.command(word(optimise, "study optimise"))
app.command(word(identify, "study identify"))
app.command(word(derivatives, "study derivatives"))
app.command(word(converge, "study converge"))
app.command(word(forces, "study forces"))
app.command(word(asperities, "study asperities", into="asked"))
app.command(word(compare, "study compare"))
app.command(word(loops, "study loops"))
app.command(word(worn, "study worn", into="asked"))

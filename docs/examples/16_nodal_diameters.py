"""Nodal diameters and a Campbell diagram

Natural frequencies of the wheel, its shrouds free and stuck, and which of them an engine order meets.
"""

import tribodyn as td

wheel = td.wheel.build(td.read_scene("blade"))
families = {state: wheel.diagram(range(21), 4, state == "stuck") for state in ("free", "stuck")}
td.plot.nodal_diameters(families, "blade").savefig("nodal_diameters.png")

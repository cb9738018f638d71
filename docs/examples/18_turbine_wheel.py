"""A turbine wheel

A sector with blade, disk and damper in five contacts. Here its parts and their masses; `tribodyn run turbine`
computes it.
"""

from pathlib import Path

import tribodyn as td

inspection = td.inspect("turbine")
print(*inspection.lines()[:8], sep="\n")
inspection.write(Path())

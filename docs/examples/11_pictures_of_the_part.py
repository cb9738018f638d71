"""The part in motion

The beam at its largest swing, and its contact opened like a book.
"""

from pathlib import Path

import tribodyn as td

COARSE = {
    "geometry.n_patch": 3,
    "geometry.n_length": 4,
    "geometry.n_height": 1,
    "reduction.modes": 4,
    "harmonics.kept": [0, 1],
    "verdict.enabled": False,
}

result = td.run("beam", overrides=COARSE | {"wear": None})
for path in td.plot.render(result, Path()):
    print(path)

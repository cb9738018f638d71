"""Numbers and names that stand in pages and come from data or code are the same in both."""

import pkgutil
import re

from tribodyn import hbm


def test_the_map_of_the_solver_names_every_module() -> None:
    named = re.findall(r"\w+", (hbm.__doc__ or "").partition("\n")[2])
    for module in pkgutil.iter_modules(hbm.__path__):
        assert named.count(module.name) >= 1, module.name

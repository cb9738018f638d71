"""scikit-fem, which the extra `mesh` brings, imported where it is first used: matrices need none of it."""

from typing import Any

from tribodyn.extras import Deferred

skfem: Any = Deferred("skfem")

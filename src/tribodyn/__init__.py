"""From geometry to worn surface: vibration, friction and fretting wear of jointed parts.

    import tribodyn as td

    result = td.run("beam")                 # or a path, or a dict; td.scene_names() lists those that come along
    print(result.summary()["peak_frequency"])
    td.plot.response(result).savefig("response.png")

    life = td.studies.lives("scatter.toml")
    print(life)

    matrices = td.matrices.read("part.npz")         # or td.matrices.from_arrays(M, K)
    rows = matrices.contact_rows([[1, 0, -1]], ("t1",), area=1e-4)  # x = q_0 - q_2
    rub = td.matrices.Contact("rub", rows, "jenkins_constant", 1e5, numbers={"friction": 0.5, "normal_load": 20.0})
    structure = td.matrices.reduce(matrices, rub, loads={"shaker": 2}, outputs={"tip": 2}, damping_ratio=0.01)
    balance = structure.balance((1, 3, 5), up_to=200.0, harmonic={1: {"shaker": 5.0}})
    curve = balance.response(20.0, 200.0, points=100)
    print(curve.frequency, curve.amplitude("tip"))

Studies are in `td.studies`, those of wheels in `td.wheel`, one's own matrices in `td.matrices`, pictures in `td.plot`.
Units are SI, frequencies are in Hz on both sides. What is not in `__all__` may change without notice. Names are
imported when they are first used, so that this import takes no time; their homes stand in `__init__.pyi`."""

import ast
import importlib
import sys
from pathlib import Path
from typing import Any

_HOME = {
    alias.asname or alias.name: (str(line.module), alias.name)
    for line in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(line, ast.ImportFrom)
    for alias in line.names
}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'tribodyn' has no attribute '{name}'")
    module, attribute = _HOME[name]
    if module == __name__:
        return importlib.import_module(f"{module}.{attribute}")
    value = getattr(importlib.import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _show_results_in(shell: Any) -> None:
    """Let a shell of IPython show a Result by its numbers, its response and its part to turn."""
    if shell is not None:
        shell.display_formatter.formatters["text/html"].for_type_by_name(
            "tribodyn.workflows.result.result",
            "Result",
            lambda result: importlib.import_module("tribodyn.workflows.report.page").shown(result),
        )


if "IPython" in sys.modules:
    _show_results_in(sys.modules["IPython"].get_ipython())

"""The trade of a scene: every setting of every parameter against where that parameter tends to, with what it costs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from tribodyn.workflows.errors.cost import Measured, measure
from tribodyn.workflows.errors.ladders import Parameter, Setting, chosen, parameters_of, study_of
from tribodyn.workflows.errors.limit import limit_of
from tribodyn.workflows.errors.trade_table import QUANTITIES, Trade, TradeRow, known_of
from tribodyn.workflows.scene import scene_file

BASE = "base"


def run(
    scene: str,
    names: Sequence[str],
    overrides: Sequence[str],
    say: Callable[[str], None],
    most: int = 99,
    keep: Callable[[Trade], None] = lambda trade: None,
    earlier: Trade | None = None,
) -> Trade:
    """Measure parameters of a scene, all that it has where none is named.

    overrides : of the scene, on top of its study's base; most : settings of each parameter, the finest ones
    keep : called after each parameter with what is there
    earlier : table of the same scene, whose other parameters are taken over
    Raises  ValueError for a parameter that the scene does not have
    """
    plain = scene_file.read(scene, overrides)
    study = study_of(plain)
    base = (*study.base, *overrides)
    file = scene_file.read(scene, base)
    parameters = chosen(parameters_of(file, study), names)
    measure(file, wears=False)  # compiles what the others only use
    meter = Meter()
    response, once = meter.of(file, wears=False), meter.of(file)
    say(f"{BASE}: {once.seconds:.1f} s, {once.outcome}")
    found = Trade.begun(plain, base, once.seconds)
    if earlier is not None and (earlier.key, earlier.base) == (found.key, found.base):
        measured = {parameter.name for parameter in parameters}
        found = replace(found, rows=tuple(row for row in earlier.rows if row.parameter not in measured))
    for parameter in parameters:
        rows = []
        for row in _rows_of(scene, parameter, parameter.settings[-most:], base, meter, say):
            worn = row.values["life_cycles"] is not None or once.values["life_cycles"] is None
            less = 0.0 if worn else once.seconds - response.seconds
            rows.append(replace(row, share=(row.seconds + less) / once.seconds))
        found = replace(found, rows=(*found.rows, *rows))
        keep(found)
    return found


class Meter:
    """Measures every scene once, however many parameters have it among their settings."""

    def __init__(self) -> None:
        self._known: dict[str, Measured] = {}

    def of(self, file: scene_file.SceneFile, wears: bool = True, refined: bool = True) -> Measured:
        """As `measure`."""
        wears = wears and file.scene.wears
        key = f"{file.scene.model_dump_json()} {wears} {refined}"
        if key not in self._known:
            self._known[key] = measure(file, wears, refined)
        return self._known[key]


def _rows_of(
    scene: str,
    parameter: Parameter,
    settings: Sequence[Setting],
    base: tuple[str, ...],
    meter: Meter,
    say: Callable[[str], None],
) -> list[TradeRow]:
    found = []
    for setting in settings:
        file = scene_file.read(scene, (*base, *setting.overrides))
        try:
            measured = meter.of(file, parameter.wears(setting), setting.refined)
        except ValueError as refusal:  # such as more interface modes than there are contact DOFs
            say(f"{parameter.name}: {setting.label}: left out: {refusal}")
            continue
        say(f"{parameter.name}: {setting.label}: {measured.seconds:.1f} s, {measured.outcome}")
        found.append(_row(parameter, setting, measured))
    return judged(found)


def _row(parameter: Parameter, setting: Setting, measured: Measured) -> TradeRow:
    unknown: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    return TradeRow(
        parameter=parameter.name,
        setting=setting.label,
        size=setting.size,
        overrides=setting.overrides,
        values=measured.values,
        errors=unknown,
        doubts=unknown,
        seconds=measured.seconds,
        share=1.0,
        memory=measured.memory,
        outcome=measured.outcome,
        tunable=parameter.tunable and bool(setting.overrides),
    )


def judged(rows: Sequence[TradeRow]) -> list[TradeRow]:
    """The rows of a parameter with their errors, and with what is doubtful about their limit."""
    known = {name: known_of(rows, name) for name in QUANTITIES}
    limits = {name: limit_of(*zip(*points, strict=True)) for name, points in known.items() if points}

    def error(row: TradeRow, name: str) -> float | None:
        value = row.values[name]
        return None if value is None or name not in limits else value / limits[name].value - 1

    def doubt(row: TradeRow, name: str) -> float | None:
        return None if row.values[name] is None or name not in limits else limits[name].doubt

    return [
        replace(row, errors={n: error(row, n) for n in QUANTITIES}, doubts={n: doubt(row, n) for n in QUANTITIES})
        for row in rows
    ]

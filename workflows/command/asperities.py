"""The word of the command `tribodyn` that finds the asperities of measured faces."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from tribodyn.workflows.command.words import Json, make_room, print_lines, quantity


def asperities(
    first: Path,
    second: Path | None = None,
    *,
    cutoff: str | None = None,
    shortest: str | None = None,
    mirror: Literal["x", "y"] | None = None,
    spacing: Annotated[str | None, Parameter(name="--spacing")] = None,
    lateral_unit: str = "1 m",
    height_unit: str = "1 m",
    rows: int = 101,
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Find the asperities of a rough face, or of two that touch: the numbers and the table of the contact law `rough`.

    Parameters
    ----------
    first
        Height map: text, SDF, or what the optional package surfalize reads.
    second
        Height map of the face that touches it; a plane by default.
    cutoff
        Wavelength above which waves are no roughness, such as 0.8mm; only the mean plane is taken off by default.
    shortest
        Wavelength below which waves are noise of the instrument; all are kept by default.
    mirror
        Axis of the second map that is reversed before it faces the first.
    spacing
        Steps along x and y of text files that hold a matrix of heights, such as "1um, 1um".
    lateral_unit
        Unit of lateral coordinates in text files, such as um.
    height_unit
        Unit of heights in text files, such as um.
    rows
        Rows of the table.
    out
        File of the table (.csv) for the key `table` of the contact.
    """
    from tribodyn.workflows.studies.surfaces import asperities as find

    make_room(out, (".csv",))
    lengths = {
        name: None if text is None else quantity(f"--{name}", text, "m")
        for name, text in (("cutoff", cutoff), ("shortest", shortest))
    }
    steps = None if spacing is None else [quantity("--spacing", word.strip(), "m") for word in spacing.split(",")]
    if steps is not None and len(steps) != 2:
        raise ValueError(f'--spacing {spacing}: give two steps, along x and y, such as "1um, 1um"')
    found = find(
        first,
        second,
        **lengths,
        mirror=mirror,
        spacing=None if steps is None else (steps[0], steps[1]),
        lateral_unit=_unit("--lateral-unit", lateral_unit),
        height_unit=_unit("--height-unit", height_unit),
    )
    table = found.table(rows)
    if out is not None:
        import numpy as np

        np.savetxt(out, table, delimiter=",", header="gap m, asperities per m2 and m of gap", fmt="%.9g")
    m = found.moments
    record = {
        "summits": len(found.height),
        "radius_m": found.radius,
        "density_per_m2": found.density,
        "deviation_m": float(found.height.std()),
        "mean_height_m": float(found.height.mean()),
        "largest_gap_m": float(found.gap.max()),
        "moments": {"m0_m2": m.m0, "m2": m.m2, "m4_per_m2": m.m4, "alpha": m.alpha},
        "gaussian": {
            "radius_m": m.radius,
            "density_per_m2": m.density,
            "deviation_m": m.deviation,
            "mean_height_m": m.mean,
        },
        "repairs": list(found.repairs),
        "table": None if out is None else str(out),
    }
    if as_json:
        print(json.dumps(record, indent=2))
        return
    lines = [
        ("summits", f"{len(found.height)} on {found.area:.3g} m2"),
        ("", f"{'found':>12} {'if Gaussian':>12}"),
        ("radius", f"{found.radius:12.4g} {m.radius:12.4g} m"),
        ("density", f"{found.density:12.4g} {m.density:12.4g} 1/m2"),
        ("deviation", f"{found.height.std():12.4g} {m.deviation:12.4g} m, of their heights"),
        ("mean height", f"{found.height.mean():12.4g} {m.mean:12.4g} m, above the mean plane"),
        ("moments", f"m0 {m.m0:.4g} m2, m2 {m.m2:.4g}, m4 {m.m4:.4g} 1/m2, alpha {m.alpha:.3g}"),
        *(("repaired", sentence) for sentence in found.repairs),
    ]
    print_lines(lines)
    if out is not None:
        print_lines([("for a contact", f'law = "rough", table = "{out.name}", radius = "{found.radius:.6g} m"')])


def _unit(name: str, text: str) -> float:
    """Metres of a unit such as "um" or "1 um"."""
    value = quantity(name, text if text.strip()[:1].isdigit() else f"1 {text}", "m")
    if not value > 0:
        raise ValueError(f"{name} {text}: give a unit of length such as um")
    return value


COMMANDS = (asperities,)

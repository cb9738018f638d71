"""Words of the command `tribodyn` on nonlinear modes: their backbone, and a free decay in time from one."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tribodyn.workflows.command.words import Changes, Json, Overrides, Start, Stop, make_room, print_lines, quantity

if TYPE_CHECKING:  # the program starts sooner without them
    from tribodyn.workflows.scene.scene_file import SceneFile
    from tribodyn.workflows.studies.curves.backbones import Way
    from tribodyn.workflows.studies.curves.changed_backbones import Changed


def backbone(
    scene: str,
    *,
    start: Start = None,
    stop: Stop = None,
    mode: int | None = None,
    points: int | None = None,
    change: Changes = (),
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Follow a nonlinear mode: frequency and damping against amplitude, as a table and a plot.

    Where NAME.published.toml beside the scene has a table [backbone], what it says stands beside it.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file; its harmonic loads play no part.
    start
        Amplitude of the response to begin at, such as 1um; [backbone] of the scene by default.
    stop
        Amplitude to end at, such as 1mm.
    mode
        Number of the mode about the static equilibrium, from 0; 0 or that of [backbone] by default.
    points
        Points on an easy way; there are more where the backbone bends. 40 or those of [backbone] by default.
    change
        Follow it again with this changed and say what it does, such as "harmonics.samples=256", or several keys joined
        by ";"; can be repeated: what harmonics, samples and meshes change is their error.
    out
        Folder of backbone.csv, backbone.png and, where faces rub, backbone_maps.png; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.pictures.maps import backbone_maps
    from tribodyn.workflows.run.progress import Progress, console_progress
    from tribodyn.workflows.studies.curves import backbones as modes
    from tribodyn.workflows.studies.curves import changed_backbones
    from tribodyn.workflows.studies.published import published_backbone

    file, asked, folder = _asked(scene, overrides, start, stop, mode, points, out)
    published, others = published_backbone(file), changed_backbones.changed_scenes(file, change)
    progress = Progress() if as_json else console_progress()
    model, found = modes.follow_with_model(file, asked, progress)
    written = [folder / "backbone.csv", folder / "backbone.png"]
    modes.write(found, written[0])
    modes.picture(found, file.name, published).savefig(written[1])
    printed = None if published is None else modes.beside(found, published)
    maps = backbone_maps(model.balance, found, file.name)
    if maps is not None:
        written.append(folder / "backbone_maps.png")
        maps.savefig(written[-1])
    changed = changed_backbones.follow(file, asked, model, found, others, progress)
    if as_json:
        said = modes.record(found) | ({} if printed is None else {"published": printed})
        said |= {"changes": [one.record() for one in changed]} if changed else {}
        print(json.dumps(said, indent=2))
    else:
        hertz, damping = found.omega / (2 * math.pi), 100 * found.damping
        print_lines(
            [
                ("at rest", f"{found.reference_omega / (2 * math.pi):.6g} Hz"),
                ("frequency", f"{hertz[0]:.6g} -> {hertz[-1]:.6g} Hz"),
                ("damping", f"{damping[0]:.4g} -> {damping[-1]:.4g} %, largest {damping.max():.4g} %"),
                *_beside(printed),
                *_changed(changed),
                ("end", str(found.end)),
            ]
        )
        print(*written, sep="\n")


def _beside(others: dict[str, Any] | None) -> Iterator[tuple[str, str]]:
    """What is published of a backbone, as lines: at three of its amplitudes, ours after it."""
    if others is None or not others["rows"]:
        return
    rows = others["rows"]
    for row in (rows[0], rows[len(rows) // 2], rows[-1]):
        yield (
            others["source"] if row is rows[0] else "",
            f"at {row['modal_amplitude']:.3g} m kg^0.5: {row['frequency_hz']:.5g} Hz ({100 * row['shift']:+.2f} %), "
            f"{100 * row['damping']:.3g} %; here {row['our_frequency_hz']:.5g} Hz ({100 * row['our_shift']:+.2f} %), "
            f"{100 * row['our_damping']:.3g} %",
        )


def _changed(changed: Sequence[Changed]) -> Iterator[tuple[str, str]]:
    """What changes of the scene do, as lines: at the first, a middle and the last amplitude."""
    from tribodyn.workflows.studies.curves.changed_backbones import summed

    for one in changed:
        at = [0, len(one.modal_amplitude) // 2, -1]
        frequency, damping = (", ".join(f"{100 * v[i]:+.3g}" for i in at) for v in (one.frequency, one.damping))
        yield one.change, f"frequency {frequency} %, damping {damping} % in {one.seconds:.3g} s"
    if changed:
        frequency, damping = (f"{100 * share:.3g} %" for share in summed(changed))
        yield "all of them", f"frequency {frequency}, damping {damping} at most, summed without signs"


def ring_down(
    scene: str,
    *,
    start: Start = None,
    stop: Stop = None,
    mode: int | None = None,
    points: int | None = None,
    periods: int = 400,
    steps: int = 256,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Let a nonlinear mode decay freely in time: frequency and damping from its output, beside the backbone.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file; its harmonic loads play no part.
    start
        Amplitude of the response at which the decay ends, such as 1um; [backbone] of the scene by default.
    stop
        Amplitude at which it begins, such as 1mm.
    mode
        Number of the mode about the static equilibrium, from 0; 0 or that of [backbone] by default.
    points
        Points of the backbone on an easy way; 40 or those of [backbone] by default.
    periods
        Periods after which the decay ends at the latest.
    steps
        Time steps per period.
    out
        Folder of ring_down.csv and ring_down.png; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.run.progress import Progress, console_progress
    from tribodyn.workflows.studies.curves import decay

    file, asked, folder = _asked(scene, overrides, start, stop, mode, points, out)
    found = decay.follow(file, asked, periods, steps, Progress() if as_json else console_progress())
    decay.write(found, folder / "ring_down.csv")
    decay.picture(found).savefig(folder / "ring_down.png")
    said = decay.record(found)
    if as_json:
        print(json.dumps(said, indent=2))
        return
    first, last = said["rows"][0], said["rows"][-1]
    print_lines(
        [
            ("amplitude", f"{first['amplitude_m']:.4g} -> {last['amplitude_m']:.4g} m"),
            ("frequency", f"{first['frequency_hz']:.6g} -> {last['frequency_hz']:.6g} Hz"),
            ("damping", f"{100 * first['damping']:.4g} -> {100 * last['damping']:.4g} %"),
            ("from the backbone", f"frequency at most {_percent(said['largest_frequency_difference'])} off"),
            ("", f"damping at most {_percent(said['largest_decrement_difference'])} off its decrement"),
            ("", f"and {_percent(said['largest_damping_difference'])} off its damping ratio, which counts otherwise"),
            ("end", said["end"]),
        ]
    )
    print(folder / "ring_down.csv", folder / "ring_down.png", sep="\n")


def _asked(
    scene: str,
    overrides: Overrides,
    start: str | None,
    stop: str | None,
    mode: int | None,
    points: int | None,
    out: Path | None,
) -> tuple[SceneFile, Way, Path]:
    """The scene, what of its nonlinear mode is asked for, and the folder for what is found, which is made."""
    from tribodyn.workflows.scene import scene_file
    from tribodyn.workflows.studies.curves import backbones as modes

    make_room(out)
    file = scene_file.read(scene, overrides)
    ends = [None if end is None else quantity(name, end, "m") for name, end in (("--from", start), ("--to", stop))]
    asked = modes.way(file, ends[0], ends[1], mode, points)
    folder = out or Path("results") / file.name
    folder.mkdir(parents=True, exist_ok=True)
    return file, asked, folder


def _percent(share: float | None) -> str:
    return "(no common amplitude)" if share is None else f"{100 * share:.3g} %"


COMMANDS = (backbone, ring_down)

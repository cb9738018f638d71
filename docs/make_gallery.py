"""Make the gallery of the site: every scene that comes along, every kind of picture, films.

    ./tribodyn gallery                       runs every scene as it is shipped, half an hour
    ./tribodyn gallery --results FOLDER      takes FOLDER/NAME/result.h5 where they are complete

Leaves docs/gallery/pictures/*.png and *.gif, docs/gallery/pictures.md that shows them, and the figures that other pages
take from the same runs.
"""

from __future__ import annotations

import argparse
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

import tribodyn as td
from tribodyn.workflows.pictures import film as films, response_plots
from tribodyn.workflows.studies import front_door

FOLDER = Path(__file__).parent
PICTURES = FOLDER / "gallery" / "pictures"
PAGE = FOLDER / "gallery" / "pictures.md"
DPI, FILM_DPI, FILM_IMAGES = 100, 55, 16
COLOURS = 256  # of a picture on the site
ELSEWHERE = {
    ("vane", "patch"): "vane_patch", ("vane", "frf"): "vane_frf", ("beam", "frf"): "beam_frf",
    ("beam", "patch"): "beam_patch", ("blade", "wheel"): "blade_wheel",
    ("brb_flat", "patch"): "brb_patch", ("brb_flat", "part"): "brb_part", ("turbine", "frf"): "turbine_frf",
    ("turbine", "patch"): "turbine_patch", ("turbine", "wheel"): "turbine_wheel",
}  # fmt: skip

KINDS = {
    "frf": "Response between its free and stuck references, and the cycle that wears at each step.",
    "outputs": "Amplitude of every observed output.",
    "cycles_per_step": "Cycles that each wear step stands for.",
    "peak": "Amplitude and frequency of the cycle that wears.",
    "preload": "Static normal force of the contact.",
    "depth": "Depth and worn area.",
    "energy": "Friction work per cycle, and worn volume against it.",
    "status": "Share of the patch in each contact status.",
    "hysteresis": "Loops of the pairs that dissipate most.",
    "normal": "Normal force over approach.",
    "patch": "Depth, status and mean pressure on the patch, each column on its own scale.",
    "status_maps": "Contact status over wear.",
    "part": "The part at its largest swing; the contact is outlined.",
    "contact": "Both faces of the contact, opened like a book.",
    "contact_*": "The same of one contact among several.",
    "wheel": "All blades at one instant.",
    "film_wear": "Depth, status and pressure over wear.",
    "film_cycle": "One cycle: the part in motion and the status of every pair.",
    "nodal_diameters": "Frequencies over nodal diameters, contact free and stuck.",
    "safe": "SAFE diagram: which modes an engine order meets in a range of speeds.",
    "campbell": "Campbell diagram of some engine orders.",
}

CHANGED = {"rig": ("verdict.enabled=false",)}  # its verdict takes longer than all else here


def main() -> None:
    """Make everything; a result that is complete already is taken."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--results", type=Path, default=Path("results/gallery"), help="folder of the results")
    words.add_argument("--only", nargs="*", default=None, help="names of scenes, or studies; all by default")
    arguments = words.parse_args()
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in [*td.scene_names(), "studies"]:
        if arguments.only is None or name in arguments.only:
            print(name, flush=True)
            with TemporaryDirectory() as folder:
                for picture in studies(Path(folder)) if name == "studies" else of_scene(name, arguments.results / name):
                    print(f"  {picture.name}, {picture.stat().st_size / 1e3:.0f} kB", flush=True)
    write_page()


def of_scene(name: str, folder: Path) -> Iterator[Path]:
    """Run a scene, and draw all that its result has."""
    result = td.run(name, folder, overrides=CHANGED.get(name, ()), resume=(folder / "result.h5").exists())
    for stale in PICTURES.glob(f"{name}_contact*.png"):
        stale.unlink()  # its contacts may have other names now
    with TemporaryDirectory() as place:
        start, spent = time.perf_counter(), time.process_time()
        written, missing = front_door.draw(result, Path(place), dpi=DPI)
        if missing:
            print(f"  {missing}")
        seconds, processor = time.perf_counter() - start, time.process_time() - spent
        print(f"  {len(written)} pictures, {seconds:.0f} s, {processor:.0f} s of processor")
        for path in written:
            yield small(path, f"{name}_{path.stem}")
            if (name, path.stem) in ELSEWHERE:
                shutil.copy(
                    PICTURES / f"{name}_{path.stem}.png", FOLDER / "figures" / f"{ELSEWHERE[name, path.stem]}.png"
                )
        for over in ("wear", "cycle"):
            if over == "cycle" or result.wear_steps:
                spent = time.process_time()
                (film,) = films.film(
                    result, place, over, formats=("gif",), images=FILM_IMAGES, dpi=FILM_DPI,
                    row=0 if over == "cycle" and result.wear_steps else None,
                    deformation=result.scene.pictures.deformation_scale, wear=result.scene.pictures.wear_scale,
                )  # fmt: skip
                print(f"  film over {over}: {(time.process_time() - spent) / FILM_IMAGES:.2f} s of processor an image")
                yield Path(shutil.copy(film, PICTURES / f"{name}_film_{over}.gif"))
        if name == "vane":
            story(result, FOLDER / "figures" / "vane_story.png", Path(place))


def story(result: td.Result, path: Path, place: Path) -> Path:
    """One picture of a wear run: the part in motion, its contact opened and worn, the response before and after."""
    from tribodyn.workflows.pictures import render

    first, last = (result_at(result, row) for row in (0, len(result.fields.row) - 1))
    panels = []
    for number, make in enumerate(
        (
            lambda: render.figures(first)["part"](),
            lambda: render.figures(last)["contact"](),
            lambda: response_plots.response(result),
        )
    ):
        file = place / f"panel_{number}.png"
        make().savefig(file, dpi=DPI)
        panel = Image.open(file).convert("RGB")
        panels.append(panel.crop((0, 0, panel.width, int(panel.height * (0.37 if number == 1 else 1)))))
    high = max(panel.height for panel in panels)
    image = Image.new("RGB", (sum(panel.width for panel in panels), high), "white")
    x = 0
    for panel in panels:
        image.paste(panel, (x, (high - panel.height) // 2))
        x += panel.width
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    return path


def result_at(result: td.Result, at: int) -> td.Result:
    """A result that shows one of its states only."""
    fields, loops = result.fields, result.loops
    return replace(
        result,
        fields=replace(fields, row=fields.row[[at]], displacement=fields.displacement[[at]]),
        loops=None
        if loops is None
        else replace(loops, row=loops.row[[at]], displacement=loops.displacement[[at]], force=loops.force[[at]]),
    )


def studies(folder: Path) -> Iterator[Path]:
    """What the studies draw: modes of the blade's wheel."""
    orders, figures = (1, 2, 3, 5, 8, 12, 20), td.wheel.modes("blade", 110.0, 120.0).figures()
    speeds, waves, critical = td.wheel.campbell(td.wheel.build(td.read_scene("blade")), 150.0, 5, orders, 1)
    for name, figure in {
        "blade_nodal_diameters": figures["nodal_diameters"],
        "blade_safe": figures["safe"],
        "blade_campbell": td.plot.campbell(speeds, waves, orders, critical, "blade"),
    }.items():
        path = folder / f"{name}.png"
        figure.savefig(path, dpi=DPI)
        yield small(path, name)
    shutil.copy(PICTURES / "blade_campbell.png", FOLDER / "figures" / "blade_campbell.png")


def small(path: Path, name: str) -> Path:
    """A picture with few colours, as the site has it."""
    target = PICTURES / f"{name}.png"
    with Image.open(path) as image:
        image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)
    return target


def write_page() -> None:
    """The page of all pictures that are there, scene by scene."""
    lines = [
        "# Pictures of every scene", "",
        "`tribodyn run`, `draw` and `wheel` draw these pictures; `./tribodyn gallery` made them and this page.", "",
        "| picture | shows |", "|---|---|", *(f"| `{kind}` | {caption} |" for kind, caption in KINDS.items()), "",
    ]  # fmt: skip
    for name in td.scene_names():
        pictures = [
            line
            for kind in KINDS
            for path in sorted(PICTURES.glob(f"{name}_{kind}.*"))
            for line in (f"![`{path.stem.removeprefix(f'{name}_')}`](pictures/{path.name})", "")
        ]
        lines += [f"## {name.replace('_', ' ')}", "", *pictures] if pictures else []
    PAGE.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""The pages are true: what README and site print as commands and Python runs as printed, see tests.helpers.pages.

The build of the documentation, a step of the same check, follows docs.outputs.FOLLOWED and fails where a command does.
"""

import importlib
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from filelock import FileLock
from PIL import Image

import tribodyn as td
from docs.outputs import FIRST, FOLLOWED, OWN_PART, SHARED
from tests.helpers.command import printed_record, refusal
from tests.helpers.pages import README, ROOT, SHOWN, fences, follow, name, pages, prepare, runs, shell
from tribodyn.geometry.gmsh_session import save, session
from tribodyn.workflows.report import text
from tribodyn.workflows.scene import scene_file


@pytest.fixture(scope="session")
def after_the_first_command(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where the first command of README and site has run."""
    return share(FIRST, prepare(tmp_path_factory.mktemp("first")), lambda folder: shell(FIRST, folder))


@pytest.fixture(scope="session")
def after_the_own_part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where the tutorial of a part of one's own was followed."""
    page = ROOT / "docs/tutorials/own_part.md"
    return share(OWN_PART, tmp_path_factory.mktemp("own"), lambda folder: follow(page, folder))


def share(command: str, folder: Path, run: Callable[[Path], str]) -> Path:
    """Run a command in a folder; what it leaves and prints goes to the build of the site too, where that asks."""
    with TemporaryDirectory() as nobody:
        path = Path(os.environ.get("TRIBODYN_SHARED", nobody), SHARED[command])
        with FileLock(f"{path}.lock"):
            printed = run(folder)
            shutil.copytree(folder / "results", path / "results")
            (path / "printed").write_text(printed, encoding="utf-8")
    return folder


def test_a_part_of_ones_own_goes_from_its_drawing_to_its_worn_surface(after_the_own_part: Path) -> None:
    result = td.load(after_the_own_part / "results/arm")
    assert result.state.startswith("complete")
    numbers = result.summary()
    free, pressed = numbers["open_frequencies"], numbers["peak_frequency"]["first"]
    assert free[1] < pressed < 3000  # the first mode across the load, stiffened by the stop
    assert numbers["peak_frequency"]["last"] == pytest.approx(free[1], rel=0.02)  # worn off, the arm is free
    assert (after_the_own_part / "results/arm/pictures/part.png").stat().st_size > 10_000


GRIDS = """
[ladders.mesh]
worn_up_to = 0
sizes = [1, 1.33, 2]
set = [['geometry.mesh="arm_20.msh"'], ['geometry.mesh="arm_15.msh"'], ['geometry.mesh="arm_10.msh"']]
"""


def test_a_study_beside_the_scene_is_found(after_the_own_part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = after_the_own_part
    for size in (20, 15, 10):
        with session() as gmsh:
            gmsh.parser.setNumber("size", [1e-3 * size])
            gmsh.merge(str(folder / "arm.geo"))
            gmsh.model.mesh.generate(3)
            save(gmsh, folder / f"arm_{size}.msh")
    (folder / "arm.study.toml").write_text(GRIDS)
    words = ["study", "converge", str(folder / "arm.toml"), "--setting", "mesh", "--json", "--out", str(folder)]
    rows = printed_record(words, capsys)
    assert [row["size"] for row in rows] == [1, 1.33, 2]
    assert all(row["outcome"] == "converged" for row in rows)
    assert rows[0]["pairs"] < rows[2]["pairs"]
    assert (folder / "converge_arm.png").is_file()


@pytest.mark.parametrize(("study", "sentence"), [
    ("[knobs.x]", "unknown key knobs"),
    ("ladders = 3", "ladders: expected a table"),
    ("[ladders.x]\nsizes = [1, 2]", "ladders.x.set is missing"),
    ("[ladders", "arm.study.toml"),
])  # fmt: skip
def test_a_study_that_is_none_is_refused(after_the_own_part, study, sentence, capsys):
    (after_the_own_part / "arm.study.toml").write_text(study)
    assert sentence in refusal(["study", "converge", str(after_the_own_part / "arm.toml")], capsys)


def with_something(long: bool) -> list[Path]:
    return [
        page
        for page in pages()
        if (long or name(page).removeprefix("docs/").removesuffix(".md") not in FOLLOWED)
        and any((f.language == "sh" and f.word == "long") if long else runs(f) for f in fences(page))
    ]


@pytest.mark.parametrize("page", with_something(long=False), ids=name)
def test_a_page_does_what_it_says(page: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    written = page.read_text(encoding="utf-8")
    if f"{FIRST}\n" in written:  # the same command gives the same folder
        shutil.copytree(request.getfixturevalue("after_the_first_command"), tmp_path, dirs_exist_ok=True)
        page_without = tmp_path / "page.md"
        page_without.write_text(written.replace(f"{FIRST}\n", ""))
        page = page_without
    follow(page, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", with_something(long=True), ids=name)
def test_the_long_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    follow(page, tmp_path, long=True)


def test_the_first_command_draws_what_is_shown(after_the_first_command: Path) -> None:
    pictures = after_the_first_command / "results/vane/pictures"
    curves = {"frf", "cycles_per_step", "peak", "preload", "depth", "energy", "status", "hysteresis"}
    curves |= {"patch", "status_maps", "part", "contact", "stress", "haigh", "fatigue"}
    assert {path.stem for path in pictures.glob("*.png")} == curves
    with Image.open(ROOT / "docs/figures/vane_patch.png") as page, Image.open(pictures / "patch.png") as drawn:
        # the unworn state alone: rounding on another processor changes where the contact wears later
        shown, built = (item.crop((0, 0, item.width // 3, item.height)) for item in (page, drawn))
        size = shown.width // 8, shown.height // 8
        assert abs(shown.width / shown.height / (built.width / built.height) - 1) < 0.02
        distance = np.subtract(*(np.asarray(item.convert("RGB").resize(size), float) for item in (shown, built)))
    assert np.abs(distance).mean() < 5  # of 255: the same picture, up to fonts and rounding


def test_the_readme_shows_what_the_first_command_prints(after_the_first_command: Path) -> None:
    """All but the seconds; where numbers have changed, put what is printed here into the README.

    The contact wears along a motion that never repeats itself, which rounding on another processor changes: numbers
    are the same within what their statistics allow, the life within its error, and the words but for lines of wear."""
    (shown,) = [fence.text for fence in fences(README) if fence.language == "text"]
    printed = "\n".join(text.brief(td.load(after_the_first_command / "results/vane"))) + "\n"
    number = re.compile(r"\d+(?:\.\d+)?")
    by_rounding = re.compile("cycles|life|opens|depth|worn  |in the end|end of wear|leaves it")
    firm = [[line for line in lines.splitlines()[1:] if not by_rounding.search(line)] for lines in (shown, printed)]
    assert [number.sub("#", line).split() for line in firm[0]] == [number.sub("#", line).split() for line in firm[1]], (
        printed
    )
    for before, now in zip(*firm, strict=True):
        of_an_error = re.search(r"([\d.]+) %", before)
        for old, new in zip(map(float, number.findall(before)), map(float, number.findall(now)), strict=True):
            allowed = 0.5 if of_an_error and old == float(of_an_error[1]) else 0.03
            assert abs(new - old) <= allowed * old, (before, now)
    of_wear = [re.search(r"life +([\d.]+) billion cycles +([\d.]+) %", lines) for lines in (shown, printed)]
    assert of_wear[0] is not None
    assert of_wear[1] is not None, printed
    (refined, _), (current, error) = (map(float, result.groups()) for result in of_wear if result is not None)
    assert abs(refined / current - 1) < error / 100


def test_the_scene_of_the_readme_is_one_of_fifteen_lines() -> None:
    (shown,) = [fence.text for fence in fences(README) if fence.language == "toml"]
    assert len(shown.splitlines()) == 15
    scene_file.parse(shown, "pressed.toml", (), ROOT)


def test_every_fence_is_known() -> None:
    """A label with a slip of the pen would be a fence that nobody runs."""
    for page in pages():
        for fence in fences(page):
            assert fence.language in SHOWN | {"sh"}, (name(page), fence.language)
            if fence.language == "sh":
                assert fence.word in ("", "long", "check"), (name(page), fence.word)


def test_the_check_is_what_ci_runs() -> None:
    assert any(f.text == "./tribodyn check\n" for f in fences(README) if (f.language, f.word) == ("sh", "check"))
    assert 'tribodyn" check' in (ROOT / ".ci/run").read_text()


def test_pictures_and_links_are_there() -> None:
    for page in pages():
        message = re.sub(r"`[^`\n]*`", "", page.read_text(encoding="utf-8"))
        for target, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)]*))?\)", message, re.S):
            if "://" in target:
                continue
            refined = page.parent / target if target else page
            assert refined.exists(), (name(page), target)
            if anchor and refined.suffix == ".md":
                assert anchor in anchors(refined), (name(page), target, anchor)


def anchors(page: Path) -> set[str]:
    """What a link may name in a page: its headings, written as GitHub and MyST do (conf.py: myst_heading_anchors)."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#{1,3} (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_tests_that_pages_name_exist() -> None:
    saved = {item.name for folder in ("tests", "proof") for item in (ROOT / folder).rglob("test_*.py")}
    named = {(page.name, test) for page in pages() for test in re.findall(r"test_\w+\.py", page.read_text("utf-8"))}
    assert named
    assert not [item for item in named if item[1] not in saved]


def test_names_of_python_in_pages_exist() -> None:
    called = re.compile(r"(?<![\w./\"-])(?:td|tribodyn)\.((?!NAME)[a-zA-Z_][\w.]*\w)")
    for page in [*pages(), *(ROOT / "docs").glob("examples/*.py"), ROOT / "docs/reference/examples.py"]:
        for result in set(called.findall(page.read_text(encoding="utf-8"))):
            assert exists(result.split(".")), (name(page), result)


def exists(names: list[str]) -> bool:
    """Whether `tribodyn.A.B` is a module, or a name of one."""
    item: object = td
    for count, word in enumerate(names, 1):
        try:
            item = getattr(item, word, None) or importlib.import_module(".".join(["tribodyn", *names[:count]]))
        except ImportError:
            return False
    return True


def test_the_paper_states_what_the_first_command_prints() -> None:
    """Its numbers are those of the README, which are those of the command."""
    paper = (ROOT / "paper/paper.md").read_text(encoding="utf-8")
    match = re.search(r"`tribodyn run vane`.*?about a minute", paper, re.DOTALL)
    (shown,) = [fence.text for fence in fences(README) if fence.language == "text"]
    numbers = re.findall(r"\d[\d.]*(?: billion cycles| DOFs| %)?", match[0])
    assert len(numbers) >= 4
    assert [number for number in numbers if number not in shown] == []
    life = re.search(r"life +([\d.]+ billion cycles) +([\d.]+ %)", shown)
    assert "{} with an error of {}".format(*life.groups()) in " ".join(match[0].split())


def test_readme_is_short() -> None:
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 120
    assert len(text.split()) <= 600

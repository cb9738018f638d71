"""Properties of scenes with garbage in them: a plan or a run, or one sentence and exit code 2, never a traceback.

More cases, drawn anew at every run, on demand: see test_properties_solver."""

import contextlib
import io
import re
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from tests.helpers.matrix_scene import SCENE
from tests.helpers.random_problems import cases
from tests.helpers.verification_models import random_structure
from tribodyn.workflows.command import main as cli
from tribodyn.workflows.scene import scene_file

TEXTS = {name: scene_file.find(name).read_text(encoding="utf-8") for name in scene_file.names()}
GARBAGE = (
    "0", "-1", "1", "2", "3", "7", "0.5", "-0.0", "1e-300", "1e300", "inf", "nan", "1e999", "true", "false", "[]", "{}",
    "[0, 1]", "[1, 0]", "[-1]", "[[0]]", '["n"]', '["t1", "n"]', '["a", "b"]', "{a = 1}", '""', '"x"', '"auto"',
    '"3 mm"', '"-3 mm"', '"1e9 N"', '"5 kg"', '"10 Hz"', '"1 %"', '"-1 %"', '"90 deg"', '"0 deg"', '"z"', '"-x"',
    '"\\u00e4\\u0000"', '"../../etc"', "1979-05-27", "plain words", "'", '"', "[", "=", "",
)  # fmt: skip
NUMBERS = ("0", "-1", "1", "2", "5", "1e-12", "1e-3", "1e3", "1e12", "1e300", "nan", "inf", "-inf")
WORDS = ("x", "material", "contact", "n", "law", "0", "frequency", "harmonics.kept", "wear.step", "loads.static.a")


def entries(table: dict[str, Any], before: str = "") -> list[tuple[str, Any]]:
    """Dotted keys of everything in a scene with their values, tables included."""
    rows: list[tuple[str, Any]] = []
    for name, value in table.items():
        rows.append((f"{before}{name}", value))
        if isinstance(value, dict):
            rows += entries(value, f"{before}{name}.")
    return rows


def measures(values: list[tuple[str, Any]]) -> list[tuple[str, str]]:
    """Keys that hold a number, with its unit as it stands after the number."""
    numbers = [(key, re.fullmatch(r"[-+.\deE]+( [^ ]+)", value)) for key, value in values if isinstance(value, str)]
    bare = [(key, "") for key, value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    return [(key, match[1]) for key, match in numbers if match] + bare


ENTRIES = {name: entries(tomllib.loads(text)) for name, text in {**TEXTS, "matrices": SCENE}.items()}
MEASURES = {name: measures(found) for name, found in ENTRIES.items()}


def _number(pair: tuple[tuple[str, str], str]) -> str:
    (key, unit), number = pair
    return f'{key}="{number}{unit}"' if unit else f"{key}={number}"


@st.composite
def spoilt(draw: st.DrawFn, name: str | None = None) -> tuple[str, list[str]]:
    """A scene and texts for --set that put garbage into one or two of its keys, odd numbers, or take them out."""
    scene = draw(st.sampled_from(sorted(TEXTS))) if name is None else name
    key = st.sampled_from([key for key, _ in ENTRIES[scene]])
    odd = st.tuples(st.sampled_from(MEASURES[scene]), st.sampled_from(NUMBERS)).map(_number)
    garbage = st.tuples(key, st.sampled_from(GARBAGE)).map("=".join)
    strange = st.tuples(key, st.sampled_from(WORDS), st.sampled_from(GARBAGE)).map(lambda t: f"{t[0]}.{t[1]}={t[2]}")
    return scene, draw(st.lists(odd | odd | odd | garbage | strange, min_size=1, max_size=2))


@st.composite
def broken_texts(draw: st.DrawFn) -> str:
    """The text of a scene with a piece cut out, doubled, or replaced by other signs."""
    text = draw(st.sampled_from([*TEXTS.values(), SCENE]))
    start = draw(st.integers(0, len(text)))
    end = min(len(text), start + draw(st.integers(0, 60)))
    other = draw(st.sampled_from(("", text[start:end] * 2, "\n", "=", "[[", "[contact]\n", "\x00", "é€", "1 = 2\n")))
    return text[:start] + (other or draw(st.text(max_size=5))) + text[end:]


def refusal(read: Callable[..., object], *arguments: object) -> str:
    """The sentence with which a scene is refused, empty where it is read."""
    try:
        read(*arguments)
    except scene_file.SceneError as refused:
        return str(refused)
    return ""


def leave(*arguments: str) -> tuple[int, str]:
    """Exit code and standard error of the command."""
    code, err = 0, io.StringIO()
    with contextlib.redirect_stderr(err), contextlib.redirect_stdout(io.StringIO()):
        try:
            cli.main(arguments)
        except SystemExit as stop:
            code = int(stop.code or 0)
    return code, err.getvalue()


def check(code: int, err: str, allowed: tuple[int, ...]) -> None:
    """Success in silence, or one sentence."""
    assert code in allowed, err
    if code:
        assert err.startswith("tribodyn: ")
        assert err.endswith(".\n")
        assert err.count("\n") == 1
    else:
        assert not err


def changes(overrides: list[str]) -> list[str]:
    """Arguments of the command that make the changes."""
    return [word for text in overrides for word in ("--set", text)]


@cases(300)
@given(spoilt())
@example(("rig", ["wear.step={a = 1}"]))
@example(("beam", ["wear.mission=[{x = 1}]"]))
def test_a_spoilt_scene_is_read_or_refused_in_one_sentence(drawn: tuple[str, list[str]]) -> None:
    scene, overrides = drawn
    assert "\n" not in refusal(scene_file.read, scene, overrides)


@cases(25)
@given(spoilt())
def test_a_spoilt_scene_is_planned_or_refused_in_one_sentence(drawn: tuple[str, list[str]]) -> None:
    scene, overrides = drawn
    check(*leave("plan", scene, *changes(overrides)), (0, 2))


@cases(150)
@given(broken_texts())
def test_a_broken_text_is_read_or_refused_in_one_sentence(text: str) -> None:
    assert "\n" not in refusal(scene_file.parse, text, "own.toml")


@pytest.fixture(scope="module")
def matrices(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of matrices, small enough to be run again and again."""
    folder = tmp_path_factory.mktemp("matrices")
    system = random_structure(2, n_extra=12).system
    np.savez(folder / "part.npz", M=system.mass, K=system.stiffness, C=system.damping)
    (folder / "own.toml").write_text(SCENE)
    return folder


@cases(20)
@given(spoilt("matrices"))
def test_a_spoilt_scene_runs_fails_or_is_refused_in_one_sentence(matrices: Path, drawn: tuple[str, list[str]]) -> None:
    with tempfile.TemporaryDirectory() as out:
        short = ["--set", "response.points=8", "--set", "wear.max_steps=2", "--set", "verdict.enabled=false"]
        arguments = ["run", str(matrices / "own.toml"), "--out", out, "--no-pictures", *short, *changes(drawn[1])]
        check(*leave(*arguments), (0, 2, 3))

"""The page for contributors: every path that it names exists, and each kind of file is tried by a test."""

import re

import pytest

from tests.helpers.pages import ROOT
from tribodyn.geometry import parts
from tribodyn.hbm import continuation, quantity
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.wear import law as wear_law, wear_rule
from tribodyn.workflows.scene import scene_file

PAGE = ROOT / "docs/developers/contributing.md"
PATH = re.compile(r"`((?:docs(?!/_build)|geometry|hbm|src|tests|workflows)/[\w./]*)`")


@pytest.mark.parametrize("path", sorted(set(PATH.findall(PAGE.read_text(encoding="utf-8")))))
def test_a_path_on_the_page_exists(path: str) -> None:
    """NAME and CASE stand for any file of the kind."""
    pattern = path.replace("NAME", "*").replace("CASE", "*")
    assert any(ROOT.glob(pattern.rstrip("/"))), path


@pytest.mark.parametrize(("folder", "names"), [
    ("hbm/contact/laws", contact_law.names()),
    ("hbm/wear/laws", wear_law.names()),
    ("hbm/wear/rules", wear_rule.names()),
    ("hbm/continuation/methods", continuation.names()),
    ("hbm/quantities", quantity.FILES.names()),
])  # fmt: skip
def test_every_file_of_a_folder_is_found_by_its_name(folder: str, names: list[str]) -> None:
    assert f"`{folder}/NAME.py`" in PAGE.read_text(encoding="utf-8")
    assert names == sorted(file.stem for file in (ROOT / folder).glob("*.py") if file.stem != "__init__")


def test_parts_and_scenes_are_found_by_their_files() -> None:
    general = {file.stem for file in (ROOT / "geometry").glob("*.py")}
    shipped = {file.stem for file in (ROOT / "workflows/cases").glob("*/*.py")}
    assert {"block", "beam"} <= set(parts.names()) <= general | shipped
    assert set(scene_file.names()) == {
        file.stem for file in (ROOT / "workflows/cases").glob("*/*.toml") if "." not in file.stem
    }

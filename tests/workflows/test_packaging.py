"""What is installed: one top-level package, complete, that works beside modules of the same plain names."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

import tribodyn

ROOT = Path(__file__).parents[2]
FOLDERS = ("geometry", "fem", "reduction", "hbm", "workflows")
OTHERS = 'raise ImportError("this is the module of another package")\n'  # as llama-index-workflows brings one
SMALL = [
    "harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine", "geometry.n_patch=3",
    "geometry.n_length=2", "geometry.n_height=1", "reduction.modes=3", "wear.max_steps=1", "verdict.enabled=false",
]  # fmt: skip


def clone(tree: Path) -> Path:
    """A copy of the tree, as a clean clone has it."""
    tree.mkdir()
    for name in ("pyproject.toml", "setup.py", "MANIFEST.in", "CITATION.cff", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tree)
    for name in (*FOLDERS, "src"):
        hidden = shutil.ignore_patterns("__pycache__", "*.egg-info")
        shutil.copytree(ROOT / name, tree / name, symlinks=True, ignore=hidden)
    return tree


def wheel_of(source: Path) -> Path:
    """The wheel that pip makes of a tree or of a source distribution."""
    built = source.with_name(f"{source.name}-wheel")
    words = ["-m", "pip", "wheel", str(source), "--no-deps", "--no-build-isolation", "-q", "-w", str(built)]
    subprocess.run([sys.executable, *words], check=True, capture_output=True)
    (result,) = built.glob("*.whl")
    return result


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return wheel_of(clone(tmp_path_factory.mktemp("wheel") / "tree"))


def test_a_clone_without_links_and_a_source_distribution_make_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    """Git leaves links as text files where core.symlinks is false."""
    names = [zipfile.ZipFile(wheel).namelist()]
    code = "import sys; from setuptools import build_meta; build_meta.build_sdist(sys.argv[1])"
    tree = clone(tmp_path / "tree")
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=tree, check=True, capture_output=True)
    (source,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        assert not [member.name for member in archive if not (member.isfile() or member.isdir())]
    windows = clone(tmp_path / "windows")
    for name in FOLDERS:
        link = windows / "src" / "tribodyn" / name
        target = os.readlink(link)
        link.unlink()
        link.write_text(target)
    names += [zipfile.ZipFile(wheel_of(place)).namelist() for place in (source, windows)]
    assert sorted(names[1]) == sorted(names[0])
    assert sorted(names[2]) == sorted(names[0])


def test_recipe_container_and_citation_agree_with_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = yaml.safe_load((ROOT / "recipe/recipe.yaml").read_text(encoding="utf-8"))
    renamed = {"python-gmsh": "gmsh", "matplotlib-base": "matplotlib"}
    extras = project["optional-dependencies"]
    run = [line.split(" ") for line in recipe["requirements"]["run"]]
    assert ["python", project["requires-python"]] in run
    assert sorted(renamed.get(name, name) + least for name, least in run if name != "python") == sorted(
        (*project["dependencies"], *extras["mesh"], *extras["pictures"])
    )
    assert recipe["build"]["python"]["entry_points"] == [f"tribodyn = {project['scripts']['tribodyn']}"]
    about = recipe["about"]
    assert (recipe["context"]["version"], about["license"], about["summary"]) == (
        project["version"],
        project["license"],
        project["description"],
    )
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert [str(citation[key]) for key in ("version", "license")] == [project["version"], project["license"]]
    script = (ROOT / "tribodyn").read_text(encoding="utf-8")
    libraries = re.search(r'^libraries="(.*)"$', script, re.MULTILINE)
    assert libraries
    assert f"--no-install-recommends {libraries[1]} " in (ROOT / "Dockerfile").read_text(encoding="utf-8")


def test_a_wheel_holds_one_package_with_every_file(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        fixed = {name for name in archive.namelist() if not name.endswith("/")}
    top = {name.partition("/")[0] for name in fixed}
    assert {name for name in top if not name.endswith(".dist-info")} == {"tribodyn"}
    needed = {
        f"tribodyn/{path.relative_to(ROOT)}"
        for folder in FOLDERS
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".py", ".toml", ".json") and "__pycache__" not in path.parts
    }
    assert sorted(needed - fixed) == []
    assert "tribodyn/py.typed" in fixed
    modules = {name for name in fixed if name.endswith(".py")}
    assert modules - needed == {f"tribodyn/{path.name}" for path in (ROOT / "src" / "tribodyn").glob("*.py")}


def test_the_package_imports_nothing_of_its_tests() -> None:
    files = [path for folder in (*FOLDERS, "src/tribodyn") for path in sorted((ROOT / folder).glob("**/*.py"))]
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not {name.partition(".")[0] for name in names} & {"pytest", "hypothesis", "tests"}, path


def test_the_wheel_works_from_another_folder_beside_modules_of_the_same_names(wheel: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    for name in FOLDERS:
        (site / f"{name}.py").write_text(OTHERS)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    code = "import tribodyn as td; print(td.__file__, td.__version__, *td.scene_names()); td.build; td.matrices.Balance"
    environment = {**os.environ, "PYTHONPATH": str(site)}

    def said(*words: str) -> str:
        done = subprocess.run([sys.executable, *words], cwd=elsewhere, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    where, version, *names = said("-c", code).split()
    assert Path(where).is_relative_to(site)
    assert f"-{version}-" in wheel.name
    assert set(tribodyn.scene_names()) == set(names)
    assert said("-m", "tribodyn", "--version").strip() == version


@pytest.mark.slow
def test_a_fresh_environment_runs_a_scene_beside_llama_index_workflows(wheel: Path, tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "fresh")], check=True)
    python = tmp_path / "fresh" / "bin" / "python"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    words = ["-m", "pip", "install", "-q", f"{wheel}[mesh]", "llama-index-workflows"]
    subprocess.run([python, *words], check=True, env=environment, cwd=tmp_path)
    sets = [word for text in SMALL for word in ("--set", text)]
    run = ["-m", "tribodyn", "run", "beam", "--no-pictures", *sets, "--out", "out"]
    subprocess.run([python, *run], check=True, env=environment, cwd=tmp_path)
    (site,) = (tmp_path / "fresh" / "lib").glob("python*/site-packages")
    ours = {path.name for path in site.iterdir() if path.name.startswith(("tribodyn", *FOLDERS[:-1], "tests"))}
    assert {name.partition("-")[0] for name in ours} == {"tribodyn"}

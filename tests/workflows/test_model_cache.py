"""What is kept on disk of parts and reductions: the same bits, made once, and made anew when anything of it changes."""

import hashlib
import os
import pickle
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.structures import BLOCKS, STACK
from tribodyn.workflows.run import model_cache, modelling, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import REDUCTION
from tribodyn.workflows.scene.scene_values import values_through

TINY = ("geometry.n_patch=3", "geometry.n_length=3", "geometry.n_height=1", "reduction.modes=4", "response.points=6",
        "harmonics.kept=[0, 1]", "wear.max_steps=1", "verdict.enabled=false")  # fmt: skip
LATER = ("contact.friction=0.3", "loads.harmonic.shake.value=1 kN", "damping.modal=2 %", "wear.coefficient=5e3 um3/J",
         "verdict.enabled=true", "harmonics.kept=[0, 1, 2]", "contact.normal_stiffness=1 kN/um")  # fmt: skip


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """An empty folder of entries, and what is made from now on."""
    done: list[str] = []
    monkeypatch.setenv("TRIBODYN_CACHE", str(tmp_path / "kept"))
    for name in ("make_mesh", "make_part", "plain_model"):
        own = getattr(modelling, name)

        def counted(*given: object, own: Callable[..., object] = own, name: str = name) -> object:
            done.append(name)
            return own(*given)

        monkeypatch.setattr(modelling, name, counted)
    return done


def built(*overrides: str, scene: str = "beam") -> modelling.Model:
    return modelling.build(scene_file.read(scene, (*TINY, *overrides)), Progress())


ALL = ["make_mesh", "make_part", "plain_model"]


def test_another_friction_load_damping_or_wear_meshes_and_reduces_nothing(calls: list[str]) -> None:
    built()
    assert calls == ALL
    for change in LATER:
        built(change)
    assert calls == ALL


@pytest.mark.parametrize(("change", "repeated"), [
    ("geometry.n_length=4", ALL),
    ("material.young=200 GPa", ALL[1:]),
    ("loads.static.press.direction=[0, 0.1, -1]", ALL[1:]),
    ("contact.gap=1 um", ALL[1:]),
    ("reduction.modes=5", ALL[2:]),
    ('reduction.method="residual_flexibility"', ALL[2:]),
])  # fmt: skip
def test_what_depends_on_a_number_is_made_again(calls: list[str], change: str, repeated: list[str]) -> None:
    built()
    calls.clear()
    built(change)
    assert set(calls) >= set(repeated)
    assert ("make_part" in calls) == ("make_part" in repeated)


def test_residual_flexibility_and_waves_are_those_of_their_springs(calls: list[str]) -> None:
    other = "contact.normal_stiffness=0.3 kN/um"
    method = 'reduction.method="residual_flexibility"'
    built(method)
    calls.clear()
    stiff = built(method, other).reduced.residual
    assert calls == ALL[2:]
    os.environ["TRIBODYN_CACHE"] = "off"  # put back by the fixture's monkeypatch
    single = built(method, other).reduced.residual
    np.testing.assert_array_equal(stiff.stiffness, single.stiffness)


@pytest.mark.parametrize("scene", ["beam", "blade", "leaf_seal"])
def test_a_result_is_that_without_anything_kept(calls, monkeypatch, tmp_path, scene):
    coarse = ("response.points=6", "wear=", "harmonics.kept=[0, 1]", "verdict.enabled=false")
    leaf = ("geometry.n_column=7", "geometry.pin_column=2", *coarse)
    small = {"beam": TINY, "blade": coarse, "leaf_seal": leaf}[scene]
    file = scene_file.read(scene, small)
    results = [pipeline.run(file, None, Progress()) for _ in range(2)]
    assert calls == ALL
    monkeypatch.setenv("TRIBODYN_CACHE", "off")
    results.append(pipeline.run(file, None, Progress()))
    assert calls == 2 * ALL
    for result in results[1:]:
        np.testing.assert_array_equal(result.response.response, results[0].response.response)
        np.testing.assert_array_equal(result.patch.area, results[0].patch.area)


def test_a_file_that_is_named_counts_by_its_bytes(calls: list[str], tmp_path: Path) -> None:
    (tmp_path / "scene").mkdir()
    file = scene_file.parse(*own_mesh(tmp_path / "scene"))
    modelling.build(file, Progress())
    calls.clear()
    modelling.build(file, Progress())
    assert calls == []
    with (tmp_path / "scene" / "part.msh").open("a", encoding="utf-8") as stream:
        stream.write("$Comments\nother\n$EndComments\n")
    modelling.build(file, Progress())
    assert calls == ALL


def own_mesh(folder: Path) -> tuple[str, str, tuple[str, ...], Path]:
    """The beam by a mesh file, as `scene_file.parse` takes it."""
    inputs = scene_file.read("beam", TINY)
    modelling.make_mesh(inputs, folder)
    (folder / "mesh.msh").rename(folder / "part.msh")
    begin, end = inputs.text.index("[geometry]"), inputs.text.index("[material]")
    text = inputs.text[:begin] + '[geometry]\nmesh = "part.msh"\nfixed = ["clamp"]\n' + inputs.text[end:]
    return text, "own.toml", tuple(item for item in TINY if not item.startswith("geometry")), folder


@pytest.mark.parametrize(("text", "change"), [
    (BLOCKS, "contacts.lap.friction=0.4"),
    (BLOCKS, "loads.static.press.pressure=1 MPa"),
    (BLOCKS + '[wear]\nlaw = "energy"\ncoefficient = "1e4 um3/J"\nstep = "5 %"\n',
        "contacts.lap.wear.coefficient=2e4 um3/J"),
    (STACK, "bolts.m8.preload=6 kN"),
])  # fmt: skip
def test_bodies_are_kept_too(calls: list[str], tmp_path: Path, text: str, change: str) -> None:
    for overrides in ((), (change,)):
        modelling.build(scene_file.parse(text, "bodies.toml", overrides, tmp_path), Progress())
    assert calls == ALL


@pytest.mark.parametrize(
    ("name", "text"), [("notes.txt", ""), ("part.msh", "*INCLUDE, INPUT=more.inp\n"), ("clamp.py", "")]
)
def test_nothing_is_kept_of_files_that_may_read_others(calls: list[str], tmp_path: Path, name: str, text: str) -> None:
    """`clamp` is a word of the scene: a part of that name would be the Python file beside it."""
    (tmp_path / "scene").mkdir()
    words = own_mesh(tmp_path / "scene")
    with (tmp_path / "scene" / name).open("a", encoding="utf-8") as stream:
        stream.write(f"$Comments\n{text}$EndComments\n")
    calls.clear()
    for _ in range(2):
        modelling.build(scene_file.parse(*words), Progress())
    assert calls == (1 if name == "notes.txt" else 2) * ALL


def entries(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.pickle"), key=lambda path: path.stat().st_size)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-9])


def flipped(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-2000] ^= 1
    path.write_bytes(content)


def empty(path: Path) -> None:
    path.write_bytes(b"")


def waiting(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


class Marker:
    """Its pickle creates a file named `ran` in the folder of the process."""

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, ("ran", "w")


def hostile(path: Path) -> None:
    """An entry with the digest of its content, or one signed by a key of somebody else."""
    content = pickle.dumps(Marker())
    path.write_bytes(hashlib.sha256(content).digest() + content)


def signed_by_another(path: Path) -> None:
    with path.with_suffix(".other").open("wb+") as stream:
        pickle.dump(Marker(), stream)
        stream.seek(0)
        signature, content = model_cache._signature(stream, path, b"another key"), pickle.dumps(Marker())
    path.write_bytes(signature + content)


DAMAGES = [cut, flipped, empty, waiting, hostile, signed_by_another]


@pytest.mark.faults
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_entry_is_made_again(calls, tmp_path, monkeypatch, damage):
    monkeypatch.chdir(tmp_path)
    full = built().reduced.system.stiffness
    for path in entries(tmp_path / "kept"):
        damage(path)
    np.testing.assert_array_equal(built().reduced.system.stiffness, full)
    assert calls == 2 * ALL
    built()
    assert calls == 2 * ALL
    assert not (tmp_path / "ran").exists()


def test_an_entry_under_the_name_of_another_is_not_taken(tmp_path: Path) -> None:
    model_cache._write(tmp_path / "a.pickle", "model", b"key")
    assert model_cache._read(tmp_path / "a.pickle", b"key") == "model"
    os.rename(tmp_path / "a.pickle", tmp_path / "b.pickle")
    assert model_cache._read(tmp_path / "b.pickle", b"key") is None


@pytest.mark.parametrize("place", ["kept", "config/tribodyn/cache.key"])
def test_nothing_is_kept_where_others_can_write(calls, tmp_path, monkeypatch, place):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    built()
    (tmp_path / place).chmod(0o707)
    model_cache._signing_key.cache_clear()
    built()
    assert calls == 2 * ALL


def test_a_folder_that_cannot_be_written_keeps_nothing(calls: list[str], tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("a file stands here")
    for _ in range(2):
        built()
    assert calls == 2 * ALL


def test_the_longest_unused_goes_and_what_is_too_large_is_not_kept(calls, tmp_path, monkeypatch):
    stiffer = "material.young=211 GPa"
    built()
    first = entries(tmp_path / "kept")
    built(stiffer)
    for path in entries(tmp_path / "kept"):
        age = 1 if path in first else 2
        os.utime(path, (age, age))
    monkeypatch.setattr(model_cache, "ROOM", 4.0 * first[-1].stat().st_size)
    built()  # is used again, so that the other one is the longest unused
    for young in (212, 213):
        built(f"material.young={young} GPa")
    assert sum(path.stat().st_size for path in entries(tmp_path / "kept")) <= model_cache.ROOM
    calls.clear()
    built()
    assert calls == []
    built(stiffer)
    assert calls
    monkeypatch.setattr(model_cache, "ROOM", 1e3)
    calls.clear()
    for _ in range(2):
        built("geometry.n_length=6")
    assert calls == 2 * ALL
    assert not list((tmp_path / "kept").glob("*.new"))


def test_two_at_once_make_it_once(calls: list[str]) -> None:
    threads = [threading.Thread(target=built) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert calls == ALL


def test_where_entries_lie(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("TRIBODYN_CACHE")
    assert model_cache.cache_folder() == tmp_path / "tribodyn"
    monkeypatch.setenv("TRIBODYN_CACHE", "off")
    assert model_cache.cache_folder() is None


def test_another_temperature_of_a_contact_reduces_nothing() -> None:
    table = 'contact.friction={over="temperature", at=["0 K", "400 K"], values=[0.5, 0.4]}'
    cold, hot = (
        scene_file.read("beam", (*TINY, table, *extra)).mesh_scene for extra in ((), ("contact.temperature=300 K",))
    )
    assert cold.joints["contact"].numbers != hot.joints["contact"].numbers
    assert values_through(cold, REDUCTION) == values_through(hot, REDUCTION)

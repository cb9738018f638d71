"""Files of one's own beside a scene: part, contact and wear law, continuation, scene, study; nothing else touched."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.synthetic_result import result
from tribodyn import declarations
from tribodyn.geometry import parts
from tribodyn.hbm import continuation
from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint, joint_transitions
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear import law as wear_law
from tribodyn.workflows.errors import ladders
from tribodyn.workflows.run import planning
from tribodyn.workflows.scene import scene_file

PART = """
from dataclasses import dataclass
from pathlib import Path
from tribodyn.declarations import number
from tribodyn.workflows.cases.beam import beam

@dataclass(frozen=True)
class Parameters:
    span: float = number("m", default=0.2, above=0.0)
    n_patch: int = 3

def build(parameters, path):
    beam.build(beam.Parameters(length=parameters.span, n_patch=parameters.n_patch, n_length=3, n_height=1), path)
"""

LAW = '''
"""Jenkins elements along t1 and t2 that hold a cohesion besides friction."""
from dataclasses import dataclass
import numba
from tribodyn.declarations import number
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS

COMPONENTS = (("t1", "t2", "n"),)

@dataclass(frozen=True)
class Parameters:
    friction: float = number("", low=0.0)
    cohesion: float = number("N", default=0.0, low=0.0)

def n_state(components):
    return 2

@numba.njit
def step(x, w, p, f, dfx, dfs, dsx, dss):
    N = p[2] * (x[2] - p[3])
    if N <= 0.0:
        for c in range(2):
            f[c], w[c], dsx[c, c] = 0.0, x[c], 1.0
        f[2] = 0.0
        return SEPARATES
    f[2], dfx[2, 2] = N, p[2]
    limit, bits = p[4] * N + p[5], 0
    for c in range(2):
        T = p[c] * (x[c] - w[c])
        if abs(T) <= limit:
            f[c], dfx[c, c], dfs[c, c], dss[c, c] = T, p[c], -p[c], 1.0
            bits |= STICKS
        else:
            side = 1.0 if T > 0.0 else -1.0
            f[c] = side * limit
            w[c] = x[c] - f[c] / p[c]
            dfx[c, 2], dsx[c, c], dsx[c, 2] = side * p[4] * p[2], 1.0, -side * p[4] * p[2] / p[c]
            bits |= SLIPS
    return bits
'''

WEAR = """
from dataclasses import dataclass
from tribodyn.declarations import number

@dataclass(frozen=True)
class Parameters:
    coefficient: float = number("m3/J", role="wear_coefficient", low=0.0)
    exponent: float = number("", default=1.0, above=0.0)

def depth_rate(exposure):
    own = exposure.numbers
    return own["coefficient"] * exposure.energy ** own["exponent"] / exposure.area
"""

METHOD = """
from dataclasses import dataclass, field

from tribodyn.declarations import number
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.newton import NewtonOptions

@dataclass(frozen=True)
class Options:
    spacing: float = number("Hz", above=0.0)
    newton: NewtonOptions = field(default_factory=NewtonOptions, kw_only=True)

def follow(problem, start, stop, options, on_point=None):
    n = 1 + round(abs(stop - start) / (6.283185307179586 * options.spacing))
    return natural.follow(problem, start, stop, natural.Options(n_points=n, newton=options.newton), on_point)
"""

STUDY = """
[ladders.my_grid]
sizes = [3, 5]
set = [["geometry.n_patch=3"], ["geometry.n_patch=5"]]
"""

CHANGES = {
    'part = "beam"': 'part = "my_part.py"\nspan = "210 mm"\nn_patch = 3',
    'law = "jenkins"': 'law = "my_law.py"\ncohesion = "20 N"',
    'method = "natural"': 'method = "my_method.py"\noptions = {spacing = "0.12 kHz"}',
    'law = "energy"': 'law = "my_wear.py"\nexponent = 1.1', 'transitions = "located"': 'transitions = "sampled"',
    "modes = 15": "modes = 4", "kept = [0, 1, 2, 3]": "kept = [0, 1]", "points = 100": "points = 6",
    'rule = "error_controlled"': 'rule = "thesis"\nmax_steps = 1', 'at = "800 Hz"': 'at = "peak"',
}  # fmt: skip
DROPPED = ("length =", "width =", "height =", "patch_length =", "n_patch =", "grading =", "n_length =", "n_height =")


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    lines = (scene_file.CASES / "beam" / "beam.toml").read_text().splitlines()
    text = "\n".join(line.partition("#")[0] for line in lines if not line.startswith(DROPPED))
    for previous, updated in CHANGES.items():
        assert previous in text
        text = text.replace(previous, updated)
    files = {"my_part": PART, "my_law": LAW, "my_wear": WEAR, "my_method": METHOD}
    for name, body in files.items():
        (tmp_path / f"{name}.py").write_text(body)
    (tmp_path / "mine.study.toml").write_text(STUDY)
    (tmp_path / "mine.toml").write_text(text + "\n[verdict]\nenabled = false\n")
    return tmp_path / "mine.toml"


def test_a_scene_runs_with_all_its_own_files(scene: Path) -> None:
    result = td.run(scene)
    depth = result.wear.worn[0].max()
    assert depth > 0
    extra = td.run(scene, overrides={"contact.cohesion": "2 kN", "wear.max_steps": 0})
    highest, with_more = (np.abs(r.response.response[:, 0, 1:]).max() for r in (result, extra))
    assert abs(with_more - highest) > 1e-3 * highest
    low, high = scene_file.read(str(scene)).scene.response.frequency
    points = np.linspace(low, high, 1 + round((high - low) / 120.0))  # solved peaks stand between them
    assert np.abs(result.response.omega / (2 * np.pi) - points[:, None]).min(axis=1).max() < 1e-6
    assert [*ladders.study_of(scene_file.read(str(scene))).ladders] == ["my_grid"]


@pytest.mark.parametrize(("override", "says"), [
    ("contact.stickiness=3", "unknown key contact.stickiness, known here: .*friction, cohesion"),
    ("contact.friction=", "contact.friction is missing: its numbers here are friction, cohesion"),
    ("contact.cohesion=3 mm", "contact.cohesion: expected a force .* which is a length"),
    ("contact.cohesion=-1", "contact.cohesion: expected a value at least 0.0, got -1"),
    ("wear.exponent=0", "wear.exponent: expected a value above 0.0, got 0"),
    ("wear.exponnt=1", r"unknown key wear.exponnt \(did you mean exponent\?\)"),
    ("geometry.n_patch=2.5", "geometry.n_patch: expected a whole number"),
    ("contact.law=other.py", 'contact.law: there is no file "other.py" beside the scene'),
    ("contact.law=../mine/my_law.py", "contact.law: .* is not in the scene's folder"),
    ("wear.law=/etc/hosts.py", "wear.law: .* is not in the scene's folder"),
    ("geometry.part=sub/my_part.py", "geometry.part: .* is not in the scene's folder"),
    ("response.options.pitch=3", "unknown key response.options.pitch, known here: spacing"),
    ("response.options=", "response.options.spacing is missing: its numbers here are spacing"),
    ("response.options.spacing=3 mm", "response.options.spacing: expected a frequency .* which is a length"),
    ("response.options.spacing=0", "response.options.spacing: expected a value above 0.0, got 0"),
    ("response.method=../my_method.py", "response.method: .* is not in the scene's folder"),
])  # fmt: skip
def test_what_does_not_fit_is_refused(scene: Path, override: str, says: str) -> None:
    with pytest.raises(scene_file.SceneError, match=says):
        scene_file.read(str(scene), (override,))


def test_a_link_out_of_the_folder_is_refused(scene: Path) -> None:
    inside = scene.parent / "inside"
    inside.mkdir()
    os.symlink(scene.parent / "my_law.py", inside / "linked.py")
    (inside / "my_part.py").write_text(PART)
    (inside / "my_wear.py").write_text(WEAR)
    (inside / "my_method.py").write_text(METHOD)
    (inside / "other.toml").write_text(scene.read_text().replace("my_law.py", "linked.py"))
    with pytest.raises(scene_file.SceneError, match=r"contact.law: .* is not in the scene's folder"):
        scene_file.read(str(inside / "other.toml"))


def test_reading_and_planning_run_none_of_them(scene: Path) -> None:
    for name in ("my_part", "my_law", "my_wear", "my_method"):
        path = scene.parent / f"{name}.py"
        path.write_text(path.read_text() + f"\nopen({str(scene.parent / 'ran')!r}, 'a').write('{name}')\n")
    file = scene_file.read(str(scene))
    assert file.scene.contact.numbers == {"friction": 0.5, "cohesion": 20.0}
    with pytest.raises(ValueError, match="add --allow-scripts"):
        td.plan(file)
    names = {"scene_text": scene.read_text(), "folder": str(scene.parent), "overrides": "", "scene_name": "own"}
    crafted = replace(result(), provenance={**result().provenance, **names})
    for opened in (lambda: td.verify(crafted), lambda: td.export(crafted, ["npz"], scene.parent / "out")):
        with pytest.raises(ValueError, match="add --allow-scripts"):
            opened()
    own_laws = scene_file.read(
        str(scene),
        ("geometry.part=beam", "geometry.span=", "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=3"),
    )
    assert planning.plan(own_laws).contact_pairs == 9
    assert not (scene.parent / "ran").exists()


def test_a_law_of_ones_own_locates_its_transitions_unless_it_says_otherwise(scene: Path) -> None:
    text = str(scene.parent / "my_law.py")
    basis = HarmonicBasis((0, 1), 16, "located")
    parameters = ContactParameters.of(("t1", "t2", "n"), np.ones((1, 3)), friction=0.3)
    assert joint_transitions(Joint("contact", text, parameters)) == "located"
    by_samples = scene.parent / "my_samples.py"
    by_samples.write_text(Path(text).read_text() + "\nSAMPLES_ONLY = True\n")
    joint = Joint("contact", str(by_samples), parameters)
    assert joint_transitions(joint) == "sampled"
    with pytest.raises(ValueError, match="'my_samples' does not locate its transitions: take transitions = 'sampled'"):
        aft.cycle(joint.module, np.ones((1, 3, 3)), contact_law.complete(joint.law, parameters), basis)


@pytest.mark.parametrize("name", [n for n in contact_law.names() if not hasattr(contact_law.load(n), "TABLE")])
def test_every_number_of_a_contact_law_changes_its_force(name: str) -> None:
    law, basis = contact_law.load(name), HarmonicBasis((0, 1), 64)
    components = law.COMPONENTS[0]
    x = np.random.default_rng(1).normal(size=(8, len(components), 3))
    x[:, -1, 0] += 1.0
    declared = contact_law.declared(name)

    def force(**changed: float) -> np.ndarray:
        numbers = {number.name: 0.3 for number in declared} | changed
        parameters = ContactParameters.of(components, np.ones((8, len(components))), **numbers)
        return aft.cycle(law, x, contact_law.complete(name, parameters), basis).force

    for number in declared:
        assert number.unit is not None
        assert number.meaning
        assert np.abs(force(**{number.name: 0.5}) - force()).max() > 1e-3


def test_every_file_of_a_kind_declares_what_it_takes() -> None:
    for name in wear_law.names():
        assert [n.name for n in wear_law.declared(name) if n.required] == ["coefficient"]
    for name in parts.names():
        assert declarations.read(parts.file_of(name))
    for name in continuation.names():
        assert callable(continuation.load(name).follow)
    with pytest.raises(ValueError, match="wear law 'energy' has no number exponent: its numbers are coefficient"):
        wear_law.JointWear.of("energy", coefficient=1.0, exponent=2.0)
    with pytest.raises(ValueError, match="wear law 'archard' needs coefficient"):
        wear_law.JointWear.of("archard")

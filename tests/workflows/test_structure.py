"""Scenes of several bodies: from TOML to a worn joint, named joints, what joins and loads bodies."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.structures import BLOCKS, FREE, STACK, STEEL, built
from tribodyn.geometry import blocks
from tribodyn.geometry.gmsh_session import session
from tribodyn.hbm import newton
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.continuation import nonlinear_modes
from tribodyn.hbm.outcome import BranchEnd, WearEnd
from tribodyn.reduction.linear import linear_modes
from tribodyn.workflows.errors import operating_states, refine
from tribodyn.workflows.errors.refinement_limits import DEFAULT
from tribodyn.workflows.result import summary
from tribodyn.workflows.run import modelling, pipeline, planning, sanity_checks
from tribodyn.workflows.run.damping_matrices import check_damping
from tribodyn.workflows.run.joints import contact_stiffness
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneError


def test_a_joint_between_two_bodies_carries_what_presses_them(tmp_path: Path) -> None:
    model = built(BLOCKS, tmp_path)
    assert model.part is not None
    assert model.reduced.interface.area.sum() == pytest.approx(0.04 * 0.014, rel=1e-10)
    omega = 2 * np.pi * 5e3
    solved = newton.solve(model.balance, omega, model.balance.stuck(omega))
    assert solved.converged
    assert model.balance.preload(solved.state) == pytest.approx(0.5e6 * 0.04 * 0.014, rel=1e-6)
    assert [joint.name for joint in model.balance.contact.joints] == ["lap"]


@pytest.mark.parametrize(("state", "count"), [("free", 1), ("stuck", 0)])
def test_a_damping_ratio_of_loose_bodies_is_remarked(state: str, count: int, tmp_path: Path) -> None:
    file = scene_file.parse(BLOCKS, "scene.toml", (f"damping.state={state}",), tmp_path)
    reduced = modelling.build(file, Progress()).reduced
    frequency, shapes = linear_modes(reduced, contact_stiffness(file.mesh_scene, reduced), 1)
    ratio = shapes[:, 0] @ reduced.system.damping @ shapes[:, 0] / (4 * np.pi * frequency[0])
    assert ratio == pytest.approx(0.01, rel=1e-6) or state == "free"
    remarks = check_damping(file.scene, reduced, share=0.95)
    assert len(remarks) == count
    assert all(f"{frequency[0]:.4g} Hz has {100 * ratio:.2g} % instead of 1 %" in remark for remark in remarks)


def test_a_body_that_slides_away_is_no_solution(tmp_path: Path) -> None:
    """Where all pairs slip nothing holds the free block in the mean: a residual small beside its drift says nothing."""
    outcomes = []
    for force in (10, 60, 120, 240):
        pulled = BLOCKS.replace('group = "lower.x_max"\ndirection = "x"\nvalue = "20 N"', DRIVEN.format(force))
        balance = built(pulled, tmp_path).balance
        omega = 2 * np.pi * 4e3
        solved = newton.solve(balance, omega, balance.stuck(omega))
        outcomes.append(str(solved.outcome))
        if solved.converged:
            assert balance.preload(solved.state) == pytest.approx(0.5e6 * 0.04 * 0.014, rel=1e-2)
    assert outcomes[0] == "converged"
    assert any(
        end in outcome for outcome in outcomes for end in ("slides away", "nothing holds", "no descent")
    )  # rounding decides which


DRIVEN = 'group = "upper.x_max"\ndirection = "y"\nvalue = "{} N"'


@pytest.mark.parametrize(("change", "said"), [
    (("lower.z_max", "lower.top"),
        r"the mesh has no face 'lower.top' \(did you mean 'lower.z_min'\?\); it has lower.x_max"),
    (('material = "aluminium"', 'material = "gold"'), "bodies.upper: unknown key materials.gold"),
    (('translation = ["55 mm", "3 mm", "10 mm"]', 'translation = ["55 mm", "3 mm", "60 mm"]'), "do not meet"),
    (('first = "upper.z_min"', 'firts = "upper.z_min"'), "did you mean first"),
    (('group = "upper.z_max"\npressure', 'group = "upper.block"\npressure'), "no face 'upper.block'"),
    (("n_width = 1\n", "n_witdh = 1\n"), r"unknown key n_witdh \(did you mean n_width\?\)"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    assert change[0] in BLOCKS
    with pytest.raises(ValueError, match=said) as raised:
        built(BLOCKS.replace(*change), tmp_path)
    assert "\n" not in str(raised.value)


LONGER_FIRST = ('first="lower.z_max"', 'second="upper.z_min"')


@pytest.mark.parametrize(("keys", "pairs"), [((), 21), (("vertices_only=true",), 8), (LONGER_FIRST, 9)])
def test_a_plan_counts_the_pairs_that_a_run_has(keys: tuple[str, ...], pairs: int, tmp_path: Path) -> None:
    """Three quadratic faces in a row: 21 nodes on them, eight at corners.

    Of the longer face below, 45 nodes, only the corners of the four elements that the upper one meets are pairs"""
    changes = [f"contacts.lap.{key}" for key in keys]
    planned = planning.plan(scene_file.parse(BLOCKS, "scene.toml", changes, tmp_path))
    assert planned.contact_pairs == built(BLOCKS, tmp_path, *changes).reduced.interface.n_pair == pairs


def test_a_body_without_its_material_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"either \[bodies.NAME\] with \[materials.NAME\]"):
        scene_file.parse(BLOCKS + '[geometry]\npart = "beam"\n', "scene.toml", (), tmp_path)


BAR = f"""
[scene]
title = "A beam on its patch"
[geometry]
mesh = "bar.msh"
fixed = ["clamp"]
[material]
{STEEL}
[loads.static.press]
group = "tip"
direction = "-z"
value = "2 kN"
[loads.harmonic.shake]
group = "tip"
direction = "y"
value = "900 N"
[response]
group = "tip"
direction = "y"
frequency = ["700 Hz", "900 Hz"]
[reduction]
modes = 5
[damping]
modal = "1 %"
[solver]
tolerance = 1e-12
"""
LAW = 't1 = "x"\nfriction = 0.4\n'


def bar(folder: Path) -> None:
    """A beam whose patch is one face, and the same patch cut into three."""
    x = np.linspace(0, 0.2, 9)
    across, up = np.linspace(0, 0.02, 3), np.linspace(0, 0.02, 2)
    parts = [blocks.Block(x[:6], across, up, "bar", {"u-": "clamp"})]
    parts += [blocks.Block(x[i : i + 2], across, up, "bar", {"w-": f"patch_{i}"}) for i in (5, 6, 7)]
    created = blocks.body(parts, points={"tip": (0.2, 0.01, 0.02)})
    full = np.concatenate([created.surfaces[f"patch_{i}"] for i in (5, 6, 7)])
    blocks.write(folder / "bar.msh", replace(created, surfaces={**created.surfaces, "patch": full}))


def solved(text: str, folder: Path, *overrides: str, slips: bool = True, hertz: float = 300.0) -> np.ndarray:
    """Coefficients of the first output."""
    balance = built(text, folder, *overrides).balance
    omega = 2 * np.pi * hertz
    options = newton.NewtonOptions(tolerance=1e-12, krylov=1e-6)
    solution = newton.solve(balance, omega, balance.stuck(omega), options)
    assert solution.converged
    assert (solution.state.cycle.status != contact_law.STICKS).any() == slips
    return balance.outputs(solution.state)[0]


def test_a_face_split_into_named_contacts_equals_the_one_contact(tmp_path: Path) -> None:
    bar(tmp_path)
    shares = {"tangential_stiffness": 3e7, "normal_stiffness": 4e7}

    def table(head: str, faces: str, part: float) -> str:
        stiffness = "".join(f"{name} = {value * part}\n" for name, value in shares.items())
        return f"[{head}]\n{faces}\n{LAW}{stiffness}"

    item = solved(BAR + table("contact", 'group = "patch"', 1.0), tmp_path)
    names = [table(f"contacts.c{i}", f'first = "patch_{i}"\nsecond = "ground"', 1 / 3) for i in (5, 6, 7)]
    split = solved(BAR + "".join(names), tmp_path)
    assert np.abs(split - item).max() < 1e-12 * np.abs(item).max()


def test_a_part_without_contact_has_its_linear_response(tmp_path: Path) -> None:
    bar(tmp_path)
    file = scene_file.parse(BAR, "scene.toml", ("pictures.renders=false", "pictures.plots=false"), tmp_path)
    result = pipeline.run(file, tmp_path, Progress())
    assert result.state == "complete"
    assert result.facts.contact_pairs == 0
    computed = result.response.amplitude("response")
    assert computed[0] == pytest.approx(result.references.free[0], rel=1e-6)
    assert computed[-1] == pytest.approx(result.references.free[-1], rel=1e-6)


BACK = '[loads.static.back]\ngroup = "lower.z_min"\npressure = "0.5 MPa"\n'
QUIET = ("pictures.renders=false", "pictures.plots=false", "verdict.enabled=false")


WEAK = "".join(
    f'[springs.{body}_{axis}]\ngroup = "{body}"\ndirection = "{axis}"\nstiffness = "1 N/m"\n'
    for body in ("lower", "upper")
    for axis in "xyz"
)


def test_a_free_structure_has_nonlinear_modes_those_of_one_on_weak_springs(tmp_path: Path) -> None:
    """Backbone of its tenth mode, six of them rigid, as far as it sticks: beyond, the blocks slide on each other."""
    rows = []
    for text in (FREE + BACK, FREE + BACK + WEAK):
        model = built(text, tmp_path, "damping=")
        options = nonlinear_modes.BackboneOptions(n_points=3)
        rows.append(nonlinear_modes.backbone(model.balance, 1e-8, 2e-7, 10, options=options))
    free, fixed = rows
    stuck, _ = linear_modes(model.reduced, model.balance.contact.stiffness, 11)
    assert free.frequency[0] == pytest.approx(stuck[10], rel=1e-6)
    assert free.end.kind is BranchEnd.REACHED
    for item, other in ((free.omega, fixed.omega), (free.damping, fixed.damping), (free.amplitude, fixed.amplitude)):
        assert item[-1] == pytest.approx(other[-1], rel=1e-4)
    assert free.omega[-1] == pytest.approx(free.omega[0], rel=1e-9)
    assert free.damping[-1] == pytest.approx(0, abs=1e-9)


def test_a_free_structure_is_the_limit_of_one_on_weak_springs(tmp_path: Path) -> None:
    pushed = (FREE + BACK).replace('value = "20 N"', 'value = "450 N"')  # its static place is anywhere
    options = ("damping=", "harmonics.kept=[0,1]")
    rows = [solved(text, tmp_path, *options, hertz=5e3)[1:] for text in (pushed, pushed + WEAK)]
    assert np.abs(rows[0] - rows[1]).max() < 1e-6 * np.abs(rows[1]).max()


def test_a_free_part_without_contact_responds_as_its_modes_say(tmp_path: Path) -> None:
    bar(tmp_path)
    text = BAR.replace('fixed = ["clamp"]\n', "")
    model = built(text, tmp_path, "loads.static=", "damping=", "reduction.modes=20")
    system, omega = model.part.system, 2 * np.pi * 800.0
    K, M = system.stiffness.toarray(), system.mass.toarray()
    expected = 900.0 * system.outputs["response"] @ np.linalg.solve(K - omega**2 * M, system.loads["shake"])
    assert model.balance.at(omega).outputs_lin[0, 1] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("text", "said"), [
    (FREE, r"nothing holds lower and upper, .* \(0, 0, -400\) N with \(.*\) N m about .* mm: balance them"),
    (BAR.replace('fixed = ["clamp"]\n', ""), r"nothing holds the structure, .* \(0, 0, -2000\) N .*\(0, 200, 0\)"),
])  # fmt: skip
def test_static_loads_that_nothing_balances_are_refused_with_their_resultant(tmp_path, text, said):
    bar(tmp_path)
    with pytest.raises(ValueError, match=said):
        built(text, tmp_path)


def test_a_free_structure_wears(tmp_path: Path) -> None:
    wear = '[wear]\ncoefficient = 1e-12\nrule = "thesis"\nstep = "0.5 um"\nmax_steps = 1\nat = "5 kHz"\n'
    small = FREE.replace('["4.5 kHz", "7 kHz"]\npoints = 10', '["4.9 kHz", "5.1 kHz"]\npoints = 3')
    text = small.replace('value = "20 N"', 'value = "450 N"') + BACK + wear
    result = pipeline.run(scene_file.parse(text, "scene.toml", QUIET, tmp_path), None, Progress())
    assert result.finished
    assert result.wear.work.sum() > 0
    assert result.wear.preload == pytest.approx(400.0, rel=1e-6)
    joint = summary.summary(result)["joints"]["lap"]
    assert joint["preload"] == pytest.approx({"first": 400.0, "last": 400.0}, rel=1e-6)
    assert joint["area"] == pytest.approx(8e-4)
    assert joint["volume"] == pytest.approx(1e-12 * joint["friction_work"])  # coefficient times friction work


PULL = '[loads.static.pull]\ngroup = "b.x_max"\ndirection = "x"\nvalue = "2 kN"\n'
CLAMPED = (0.03 + 0.05) / (200e9 * 0.02**2) + 1 / 500e6  # compliance of bars and joint [m/N]


@pytest.mark.parametrize("state", ["locked", "constant"])
def test_a_bolt_has_its_preload_and_the_right_stiffness_along_it(tmp_path: Path, state: str) -> None:
    k = 90e6 if state == "locked" else 0.0
    for load, pulled in (("", 0.0), (PULL, 2000.0)):
        balance = built(STACK + load, tmp_path, f"bolts.m8.state={state}").balance
        omega = 2 * np.pi * 1e3
        solution = newton.solve(balance, omega, balance.stuck(omega), newton.NewtonOptions(tolerance=1e-12))
        assert solution.converged
        elongation = balance.outputs(solution.state)[balance.compliance.output_names.index("bolts.m8"), 0]
        force = balance.excitation.loads[0, "m8"].real + k * elongation
        assert force == pytest.approx(5000.0 + pulled * k * CLAMPED / (1 + k * CLAMPED), rel=1e-8)
        assert balance.preload(solution.state) == pytest.approx(force - pulled, rel=1e-8)


SHANK = 'expansion = 12e-6\n[materials.shank]\nyoung = "90 GPa"\ndensity = 4500.0\n[bodies.a]'
HOT = STACK.replace("[bodies.a]", SHANK) + '[loads.static.hot]\ntemperature = "50 K"\n'


@pytest.mark.parametrize(("expansion", "bodies", "strain"), [
    (12e-6, ["a", "b"], 0.0),
    (0.0, ["a", "b"], 50 * 12e-6 * 0.08),
    (9e-6, ["b"], 50 * (12e-6 * 0.05 - 4.5e-6 * 0.08)),
])  # fmt: skip
def test_a_heated_joint_heats_the_shank_too(tmp_path: Path, expansion: float, bodies: list[str], strain: float) -> None:
    """A stack of springs in closed form; the shank has the mean temperature of what lies under head and nut."""
    text = HOT.replace("density = 4500.0", f"density = 4500.0\nexpansion = {expansion}")
    text = text.replace('stiffness = "90 N/um"', 'stiffness = "90 N/um"\nmaterial = "shank"')
    (tmp_path / "hot.toml").write_text(f"{text}bodies = {bodies}\n", encoding="utf-8")
    a, b = td.studies.forces(str(tmp_path / "hot.toml")).bodies
    force = 5000.0 + strain / (CLAMPED + 1 / 90e6)
    assert b.joints["bolts.m8"] == pytest.approx([-force, 0, 0], rel=1e-8, abs=1e-6)
    assert b.joints["joint"] == pytest.approx([force, 0, 0], rel=1e-8, abs=1e-6)
    assert a.is_supported
    assert not b.is_supported


def test_what_is_heated_and_does_not_expand_is_noted_and_a_shank_that_is_not_known_refused(tmp_path: Path) -> None:
    text = HOT.replace('stiffness = "90 N/um"', 'stiffness = "90 N/um"\nmaterial = "shank"')
    notes = sanity_checks.remarks(scene_file.parse(text, "hot.toml", (), tmp_path), built(text, tmp_path))
    assert notes[0] == "bolts.m8 is heated and does not expand: give its material an expansion"
    with pytest.raises(ValueError, match=r"bolts\.m8 is heated, .* give material"):
        built(HOT, tmp_path)


LEANING = STACK.replace('["30 mm", "0 mm", "0 mm"]', '["30 mm", "3 mm", "0 mm"]')  # by 3 on 80 mm


def test_a_shank_that_leans_is_named_with_its_shear(tmp_path: Path) -> None:
    """It shears the joint by N sin; below that friction the bars slide; along a given axis there is none."""
    (tmp_path / "lean.toml").write_text(LEANING, encoding="utf-8")
    lean = np.arctan(3 / 80)
    for axis, shear in (("", 5000 * np.sin(lean)), ('bolts.m8.axis="x"', 0.0)):
        _, b = td.studies.forces(str(tmp_path / "lean.toml"), overrides=[axis] if axis else []).bodies
        assert b.joints["joint"] == pytest.approx([np.sqrt(5000**2 - shear**2), shear, 0], rel=1e-8, abs=1e-5)
    model = built(LEANING, tmp_path)
    notes = " ".join(sanity_checks.remarks(scene_file.parse(LEANING, "lean.toml", (), tmp_path), model))
    assert "bolts.m8 leans by 2.15 degrees" in notes
    assert "shears the joint by 187 N, and friction below 0.0375 slides" in notes
    with pytest.raises(ValueError, match=r"preload of m8 is not reached; bolts\.m8 leans by 2.15 degrees .*axis"):
        built(LEANING.replace("friction = 0.3", "friction = 0.03"), tmp_path)
    with pytest.raises(ValueError, match=r"bolts\.m8\.axis: .* 8.54 mm off the middle"):
        built(LEANING, tmp_path, 'bolts.m8.axis="x"', "bodies.b.translation=['30 mm', '3 mm', '8 mm']")


def test_what_a_tie_carries_is_shown(tmp_path: Path) -> None:
    """A weight glued on: the tie carries what pushes it, all of it."""
    tie = '[ties.glue]\nfirst = "upper.z_min"\nsecond = "lower.z_max"\n'
    glued = BLOCKS[: BLOCKS.index("[contacts.lap]")] + tie + BLOCKS[BLOCKS.index("[loads.static.press]") :]
    (tmp_path / "glued.toml").write_text(glued, encoding="utf-8")
    lower, upper = td.studies.forces(str(tmp_path / "glued.toml")).bodies
    assert upper.load == pytest.approx([0, 0, -0.5e6 * 0.04 * 0.014], abs=1e-6)
    assert upper.joints["ties.glue"] == pytest.approx(-upper.load, abs=1e-4)
    assert lower.joints["ties.glue"] == pytest.approx(upper.load, abs=1e-4)


def lap() -> str:
    """The bolted lap joint of the site."""
    text = (Path(__file__).parents[2] / "docs/howto/several-bodies.md").read_text(encoding="utf-8")
    return text.split("```toml lap.toml\n")[1].split("```")[0]


def test_a_joint_that_never_slips_survives_instead_of_a_number_of_cycles(tmp_path: Path) -> None:
    fixed = ('bolts.m6.preload="9 kN"', 'loads.harmonic.shake.value="1 N"', 'wear.at="3 kHz"', "response.points=3")
    result = pipeline.run(scene_file.parse(lap(), "lap.toml", (*fixed, *QUIET), tmp_path), None, Progress())
    assert result.wear.end.kind is WearEnd.NEVER_SLIPS
    assert result.wear.ended.survived
    assert result.wear.cycles.tolist() == [0.0]
    assert "no pair ever slips: nothing wears, the contact survives" in result.state


def test_what_a_bolt_clamps_carries_its_force_on_small_faces_too(tmp_path: Path) -> None:
    balance = built(lap(), tmp_path).balance.with_load(0.0)
    omega = 2 * np.pi * 4e3
    solution = newton.solve(balance, omega, balance.stuck(omega), newton.NewtonOptions(tolerance=1e-10))
    assert solution.converged
    assert balance.preload(solution.state) == pytest.approx(3000.0, rel=1e-6)


def test_every_body_of_a_scene_is_refined_or_the_elements_of_all_are_halved(tmp_path: Path) -> None:
    """Parts by their counts, CAD files by their sizes; a mesh file cannot be made again, but its elements cut."""
    file = scene_file.parse(BLOCKS, "blocks.toml", folder=tmp_path)
    base, (finer, ratio) = file.scene, refine.mesh(file, 2.0)
    for name in ("lower", "upper"):
        assert finer.scene.bodies[name].parameters["n_length"] == 2 * base.bodies[name].parameters["n_length"]
    assert ratio == pytest.approx(2.0, rel=0.1)
    with session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 40, 10, 10)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "box.step"))
    drawn = (
        'mesh = "box.step"\nunit = "mm"\nface_sizes = { "face 2" = "3 mm" }\ntranslation = ["55 mm", "3 mm", "10 mm"]'
    )
    base = BLOCKS[: BLOCKS.index("[bodies.upper]")] + f'[bodies.upper]\n{drawn}\nmaterial = "aluminium"\n'
    tail = (
        BLOCKS[BLOCKS.index("[contacts.lap]") :]
        .replace("upper.z_min", "upper.face 5")
        .replace("upper.z_max", "upper.face 6")
    )
    drawn_file = scene_file.parse(base + tail, "drawn.toml", folder=tmp_path)
    upper = refine.mesh(drawn_file, 2.0)[0].scene.bodies["upper"]
    assert upper.size == pytest.approx(2e-3)  # half of a tenth of 40 mm
    assert upper.face_sizes == {"face 2": pytest.approx(1.5e-3)}
    inputs = (base + tail).replace("box.step", "box.msh").replace('face_sizes = { "face 2" = "3 mm" }\n', "")
    file = scene_file.parse(inputs, "given.toml", folder=tmp_path)
    finer, ratio = refine.mesh(file, 1.5)
    assert [finer.scene.bodies[name].halved for name in ("lower", "upper")] == [1, 1]
    assert ratio == refine.HALVED


def test_the_error_of_a_mesh_that_is_given_is_told_by_its_halved_elements(tmp_path: Path) -> None:
    """Peak of a beam from a mesh file: what the verdict would say covers the distance to elements of a quarter size."""
    bar(tmp_path)
    text = BAR.replace('["700 Hz", "900 Hz"]', '["300 Hz", "1200 Hz"]\npoints = 60').replace('"900 N"', '"1 N"')
    text = text.replace('modal = "1 %"', 'modal = "3 %"') + f'[contact]\ngroup = "patch_7"\nvertices_only = true\n{LAW}'
    text += "tangential_stiffness = 3e5\nnormal_stiffness = 4e5\n"
    files = [scene_file.parse(text, "bar.toml", (f"geometry.halved={n}",), tmp_path) for n in range(2)]
    mesh, sets = modelling.make_mesh(files[1], tmp_path)
    assert (mesh.nelements, len(sets["tip"])) == (8 * 16, 1)
    rows = [
        operating_states.unworn_state(file, modelling.build(file, Progress(), (0, 1))).values["peak_frequency"]
        for file in files
    ]
    error = DEFAULT.total(abs(rows[0] / rows[1] - 1), refine.HALVED)
    assert 0.3 * error < rows[0] / 461.658 - 1 < error  # the peak with geometry.halved=2


def test_a_bolt_presses_on_faces_of_a_cad_file(tmp_path: Path) -> None:
    """Tetrahedra: the shank has its preload, and so has the joint, whose pairs stand at mid-side nodes."""
    with session() as gmsh:
        for z in (0, 10):
            gmsh.model.occ.addBox(0, 0, z, 20, 10, 10)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "stack.step"))
    text = STACK[: STACK.index("[bodies.a]")]
    for i, (name, fixed) in enumerate((("a", 'fixed = ["left"]\n'), ("b", "")), 1):
        text += f'[bodies.{name}]\nmesh = "stack.step"\nvolume = "solid {i}"\nunit = "mm"\nsize = "9 mm"\n'
        text += f'material = "plain"\n{fixed}[bodies.{name}.faces]\n'
        text += 'left = { normal = "-x" }\ntop = { normal = "z" }\nfoot = { normal = "-z" }\n'
    tail = STACK[STACK.index("[contacts.joint]") :].replace("a.x_max", "b.foot").replace('"b.x_min"', '"a.top"')
    tail = tail.replace('"a.x_min"', '"b.top"').replace('second = "b.x_max"\npreload', 'second = "a.foot"\npreload')
    balance = built(text + tail.replace("b.x_max", "b.top").replace('t1 = "y"', 't1 = "x"'), tmp_path).balance
    balance = balance.with_load(0.0)
    omega = 2 * np.pi * 1e3
    solution = newton.solve(balance, omega, balance.stuck(omega), newton.NewtonOptions(tolerance=1e-12))
    assert solution.converged
    elongation = balance.outputs(solution.state)[balance.compliance.output_names.index("bolts.m8"), 0]
    assert balance.excitation.loads[0, "m8"].real + 90e6 * elongation == pytest.approx(5000.0, rel=1e-8)
    assert balance.preload(solution.state) == pytest.approx(5000.0, rel=1e-6)

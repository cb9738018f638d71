"""The leaf seal: what is allocated, the published frequencies, the fold, and what the study says about its cases."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from proof.cases.leaf_seal import figures as leaf_figures, fit as leaf_fit, study as leaf_study
from proof.cases.leaf_seal.cases import Case, cases, liner
from proof.cases.leaf_seal.response import LINER_NODE, respond
from tests.helpers.reduced import reduce_part
from tribodyn.hbm import newton
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS
from tribodyn.hbm.linear.recovery import coordinates
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.stepper import Options
from tribodyn.workflows.errors.judgement import with_verdict
from tribodyn.workflows.run import modelling, pipeline, planning
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.references import linear_references
from tribodyn.workflows.scene import scene_file

LOW, HIGH, UNIQUE = 144.94, 400.0, 177.0  # [Hz]: three solutions; linear; one solution that chatters


@pytest.fixture(scope="module")
def leaf():
    return respond(scene_file.read("leaf_seal_thesis"))


def built(folder, *overrides):
    """The model of the scene with changes."""
    file = scene_file.read("leaf_seal_thesis", overrides)
    mesh, node_sets = modelling.make_mesh(file, folder)
    part = modelling.make_part(file.scene, mesh, node_sets)
    return modelling.make_model(file.scene, part, reduce_part(file.scene, part))


def dense_response(balance, omega):
    """Outputs (n_output, 3) of the stuck leaf by one dense solve per harmonic, nothing shared with the balance."""
    model, k = balance.model, balance.contact.stiffness.ravel()
    system, B = model.system, model.interface.B
    outputs = np.array([system.outputs[name] for name in balance.compliance.output_names])
    amplitudes = []
    for h in (0, 1):
        s = 1j * h * omega
        loads = balance.excitation.loads.items()
        force = sum(value * system.loads[name] for (order, name), value in loads if order == h)
        D = system.stiffness + B.T @ (k[:, None] * B) + s * system.damping + s**2 * system.mass
        amplitudes.append(outputs @ np.linalg.solve(D, force))
    return balance.basis.to_real(np.stack(amplitudes, axis=1))


def test_exactly_one_unknown_for_each_pair_and_coefficient(leaf):
    balance = leaf.balance
    assert balance.contact.components == ("n",)
    assert balance.contact.n_pair == 126
    assert {face: pairs.stop - pairs.start for face, pairs in leaf.part.pairs.items()} == {
        "upper_contact": 63,
        "lower_contact": 63,
    }
    assert balance.n_unknown == 126 * 3
    assert balance.memory.size == 0
    assert leaf.state(0).cycle.jacobian.size == 126 * 3 * 3
    assert (np.diff(leaf.part.interface.B.indptr) == 1).all()
    assert balance.model.origin.n_modes == 20
    assert "378 unknowns = 126 pairs x 1 component x 3 coefficients" in leaf_study.sizes(leaf)
    assert "friction memory 0" in leaf_study.sizes(leaf)


def test_the_plan_counts_what_the_run_builds(leaf):
    plan = planning.plan(scene_file.read("leaf_seal_thesis"))
    assert (plan.contact_pairs, plan.unknowns) == (126, 378)
    assert int(plan.model_dofs) == leaf.balance.model.system.n_dof - 6  # static shapes


def test_free_leaf_has_two_rigid_modes_and_contact_alone_holds_it(tmp_path):
    model = built(tmp_path, "springs=")
    part, balance = model.part, model.balance
    frequency = balance.model.free_frequency
    assert (frequency[:2] < 1e-4 * frequency[2]).all()
    assert frequency[2] == pytest.approx(163.0, abs=2.0)
    solution = newton.solve_from_rest(balance, 2 * np.pi * UNIQUE)
    assert solution.converged
    status = solution.state.cycle.status
    assert (status & SEPARATES).any()
    assert (status == STICKS).any()
    # equilibrium of the rigid lift: what presses is what the contact carries, and nothing else helps
    lift = np.zeros((len(part.points), 3))
    lift[:, 2] = 1.0
    pressed = -3000.0 * part.system.loads["pressure"] @ lift.ravel()[part.free]
    assert solution.state.cycle.force[:, 0, 0].sum() == pytest.approx(pressed, rel=1e-7)


def test_fitted_columns_stand_beside_the_published_ones():
    scene = scene_file.read("leaf_seal_thesis").scene
    result = leaf_fit.of_scene(scene)
    errors = result.errors[leaf_fit.COUNTED]
    assert result.rms < 0.072
    assert np.median(np.abs(errors)) < 0.05
    assert np.sum(np.abs(errors) > 0.12) <= 1  # mode 3 on springs, which contradicts mode 3 alone
    assert (result.columns[0, :2] < 1e-3 * result.unit).all()
    assert (np.diff(result.columns, axis=0) > -1e-6 * result.unit).all()  # springs never lower a frequency
    assert "+11.8 %" in result.table()


def test_the_scene_has_the_stiffnesses_that_suit_its_leaf_best():
    scene = scene_file.read("leaf_seal_thesis").scene
    p = leaf_fit.dimensions(scene)
    leaf = leaf_fit.reduced_leaf(p)
    mass = 7860 * p["angle"] * p["radius"] * p["height"] * p["thickness"]
    unit, spring, contact, errors = leaf_fit.stiffnesses(leaf, mass)
    assert spring == pytest.approx(scene.springs["left_pin"].stiffness, rel=0.05)  # rounding of the seat's width
    assert contact == pytest.approx(scene.contact.normal_stiffness, rel=0.01)
    assert unit == pytest.approx(160.0, rel=0.01)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(leaf_fit.of_scene(scene).rms, rel=0.01)


def test_the_fit_stays_at_the_leaf_of_the_scene():
    scene = scene_file.read("leaf_seal_thesis").scene
    shape = leaf_fit.shape_of(leaf_fit.dimensions(scene))
    fitted = leaf_fit.fit(scene, 3, shape, max_steps=2)
    assert fitted.rms == pytest.approx(leaf_fit.of_scene(scene).rms, rel=0.003)
    np.testing.assert_allclose(leaf_fit.shape_of(fitted.parameters), shape, rtol=0.015)


def test_a_leaf_gives_way_only_to_one_that_the_numbers_tell_apart():
    base = leaf_fit.of_scene(scene_file.read("leaf_seal_thesis").scene)
    published = np.array(list(leaf_fit.PUBLISHED.values()))

    def with_errors(errors):
        return replace(base, columns=base.unit * (published + errors * np.maximum(published, leaf_fit.FLOOR)))

    noise = np.random.default_rng(3).normal(size=published.shape)
    equal, better = with_errors(base.errors + 1e-3 * noise), with_errors(0.5 * base.errors)
    assert leaf_fit.doubt(base, base) == 0.0
    assert leaf_fit.chosen(base, [better, equal]) is better
    # one number that happens to fit says nothing: here that of the largest error
    lucky = base.errors.copy()
    lucky.flat[np.abs(lucky).argmax()] = 0.0
    assert with_errors(lucky).rms < 0.9 * base.rms
    assert leaf_fit.chosen(base, [with_errors(lucky)]) is base
    # the same by hand
    errors = (base.errors[leaf_fit.COUNTED], better.errors[leaf_fit.COUNTED])
    rows = [np.sqrt(np.mean(np.delete(error, i) ** 2)) for error in errors for i in range(28)]
    difference = np.subtract(rows[:28], rows[28:])
    by_hand = np.sqrt(27 / 28 * np.sum((difference - difference.mean()) ** 2))
    assert leaf_fit.doubt(base, better) == pytest.approx(by_hand)


def test_away_from_resonance_the_leaf_answers_as_if_stuck(leaf):
    branch = leaf.branch
    stuck = (leaf.status() == STICKS).all(axis=1)
    assert stuck[0]
    assert stuck[-1]
    assert 0.5 < stuck.mean() < 0.95
    for point in np.flatnonzero(stuck)[::7]:
        exact = dense_response(leaf.balance, branch.omega[point])
        error = np.abs(branch.response[point] - exact).max(axis=1) / np.abs(exact).max(axis=1)
        assert error.max() < 1e-6


def test_the_curve_softens_through_two_folds_where_stability_changes(leaf):
    branch, height = leaf.branch, leaf.branch.amplitude(LINER_NODE)
    assert str(branch.end) == "reached 450 Hz"
    upper, lower = branch.folds
    assert branch.frequency[upper] == pytest.approx(174.74, abs=0.05)
    assert branch.frequency[lower] == pytest.approx(132.24, abs=0.1)
    assert height[lower] > 3 * height[upper]
    marks = leaf.stability
    assert marks.kinds == ("fold", "fold")
    assert not marks.stable[upper + 1 : lower].any()
    assert marks.stable[: upper - 1].all()
    assert marks.stable[lower + 2 :].all()


def test_five_points_show_linear_and_chattering_contact(leaf):
    points = leaf.chosen()
    status = [leaf.state(point).cycle.status for point in points]
    assert (status[0] == STICKS).all()
    assert (status[4] == STICKS).all()
    for statu in status[1:4]:
        assert (statu == STICKS | SEPARATES).sum() > 60
    chatter = leaf.chatter(points[2])
    assert max(map(len, chatter.closing)) == 1
    assert 0.2 < chatter.touching.min() < 1.0
    assert (chatter.impact_velocity > 0).sum() == (status[2] == STICKS | SEPARATES).sum()
    work = leaf.impact_work(points[2])
    assert ((work > 0) == (status[2] == STICKS | SEPARATES)).all()
    assert leaf.impact_work(points[0]).sum() == 0.0
    pins = leaf.pin_work(points[2])
    assert pins["left_pin"] > 0
    patches, seats = leaf.wear_rates(points[2], coefficient=3e-15)
    np.testing.assert_allclose(patches @ leaf.part.interface.area, 3e-15 * work.sum())
    np.testing.assert_allclose(seats * 4.891e-3 * 2e-3, 3e-15 * np.array(list(pins.values())))
    assert pins["left_pin"] == pytest.approx(pins["right_pin"], rel=1e-3)


@pytest.mark.slow
def test_three_solutions_share_a_frequency_and_time_integration_knows_which_are_stable():
    """Harmonics 0 to 5, at a frequency between its folds."""
    file = scene_file.read("leaf_seal_thesis", ("harmonics.kept=[0,1,2,3,4,5]", "response.frequency=[140, 180]"))
    response = respond(file)
    balance, omega = response.balance, 2 * np.pi * LOW
    assert len(response.branch.folds) == 2
    states = []
    outside = response.branch.omega - omega
    for i in np.flatnonzero(outside[:-1] * outside[1:] < 0):
        share = outside[i] / (outside[i] - outside[i + 1])
        x = (1 - share) * response.branch.contact[i] + share * response.branch.contact[i + 1]
        states.append(newton.solve(balance, omega, x.reshape(126, 1, -1)).state)
    assert [exponents.stability(balance, state).stable for state in states] == [True, False, True]
    row = balance.compliance.output_names.index(LINER_NODE)
    ours, theirs = [], []
    for state, periods in zip(states, (40, 250, 40), strict=True):
        options = Options(steps=256, max_periods=periods, accelerate=False, tolerance=1e-9)
        motion = time_integration.integrate(balance, omega, state, options)
        ours.append(float(np.linalg.norm(balance.outputs(state)[row, 1:])))
        theirs.append(float(np.sqrt(2) * motion.outputs[row].std()))
    low, middle, high = ours
    assert theirs[0] == pytest.approx(low, rel=0.01)
    assert theirs[2] == pytest.approx(high, rel=0.01)
    assert abs(theirs[1] - middle) > 0.5 * middle
    assert min(abs(theirs[1] / low - 1), abs(theirs[1] / high - 1)) < 0.5


def test_inclination_leaves_the_ends_or_the_centre_in_contact(tmp_path):
    for angle, ends in ((4.0, True), (-4.0, False)):
        model = built(tmp_path, f"contact.inclination={angle} deg")
        part, balance = model.part, model.balance
        closed = newton.solve_from_rest(balance, 2 * np.pi * HIGH).state.cycle.status != SEPARATES
        x = np.abs(part.interface.points[:, 0])
        for pairs in part.pairs.values():
            share = x[pairs] / x[pairs].max()
            centre, end = closed[pairs][share < 1 / 3], closed[pairs][share > 3 / 4]
            distance, touching = (centre, end) if ends else (end, centre)
            assert not distance.any()
            assert touching.any()


def test_liner_motion_enters_the_contact_and_the_linear_references():
    still = ("loads.harmonic.pulsation.pressure=0", "response.frequency=[300, 310]")
    shifted = respond(scene_file.read("leaf_seal_thesis", (*liner(0.0, 1j), *still)))
    base = shifted.balance.excitation.base
    assert (base[:63] == 0).all()
    np.testing.assert_allclose(base[63:, 0], 0.0)
    np.testing.assert_allclose(base[63:, 1], 0.0, atol=1e-18)
    np.testing.assert_allclose(base[63:, 2], 20e-6)  # Re(i u e^iwt) = -u sin along z, and closing is along -z
    references = linear_references(shifted.balance, "response", 2 * np.pi * 300, 2 * np.pi * 310)
    ours = shifted.branch.amplitude("response")
    np.testing.assert_allclose(references.stuck[[0, -1]], ours[[0, -1]], rtol=1e-6)
    assert np.all(references.free == 0.0)


def test_a_smaller_load_moves_the_liner_less_in_every_answer():
    """Of a linear answer, all stuck: half of the harmonic loads is half of the motion; the static part stays."""
    shifted = respond(scene_file.read("leaf_seal_thesis", (*liner(0.0, 1.0), "response.frequency=[300, 310]")))
    full, half = shifted.balance, shifted.balance.with_load(0.5)
    omega, answers = 2 * np.pi * 300, []
    for balance in (full, half):
        state = newton.solve_from_rest(balance, omega).state
        force = state.cycle.force.reshape(state.flat.shape)
        answers.append(np.stack(coordinates(balance, state.flat, force, omega), axis=-1))
        row = np.array([balance.model.at_harmonic(0)[0].outputs["response"]])
        result = balance.basis.to_real(row @ answers[-1])[0]
        messages = balance.outputs(state)[balance.compliance.output_names.index("response")]
        np.testing.assert_allclose(result, messages, atol=1e-8 * np.abs(messages).max())
    np.testing.assert_allclose(answers[1][:, 1], 0.5 * answers[0][:, 1], atol=1e-9 * np.abs(answers[0]).max())
    np.testing.assert_allclose(answers[1][:, 0], answers[0][:, 0], atol=1e-9 * np.abs(answers[0]).max())
    scaled = [linear_references(balance, "response", omega, 1.01 * omega).stuck for balance in (full, half)]
    np.testing.assert_allclose(scaled[1], 0.5 * scaled[0], rtol=1e-9)


def test_wear_by_impacts_grows_where_the_leaf_chatters(tmp_path):
    overrides = (
        "wear.law=impact", "wear.coefficient=1e-12 m3/J", f"wear.at={UNIQUE} Hz", "wear.step=2 um", "wear.max_steps=2",
        "response.frequency=[100, 180]", "verdict.enabled=false",
    )  # fmt: skip
    result = pipeline.run(scene_file.read("leaf_seal_thesis", overrides), tmp_path, Progress())
    status, worn = result.wear.status[0], result.wear.worn[0]
    assert ((worn > 0) == (status == STICKS | SEPARATES)).all()
    assert worn.max() == pytest.approx(2e-6, rel=1e-3)


@pytest.mark.slow
def test_the_study_has_its_thirty_configurations_and_writes_what_it_found(tmp_path):
    scene = scene_file.read("leaf_seal_thesis").scene
    all_cases = cases(scene)
    assert len(all_cases) == 31
    count = {
        group: sum(case.group == group for case in all_cases) for group in dict.fromkeys(c.group for c in all_cases)
    }
    assert count == {
        "liner": 7, "excitation": 4, "liner without force": 4, "K_n": 4, "K_spring": 4, "inclination": 4, "bow": 4,
    }  # fmt: skip
    for case in all_cases:
        scene_file.read("leaf_seal_thesis", case.overrides)
    impossible = Case("bow", "impossible", ("contact.plane=", "contact.inclination=1 deg"))
    small = [all_cases[0], impossible, next(case for case in all_cases if case.label == "+4°")]
    results = []
    records = leaf_study.study(small, tmp_path, results.append)
    assert [record.complete for record in records] == [True, False, True]
    assert len(results) == 3
    with open(tmp_path / "study.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["group"] for row in rows] == ["liner", "bow", "inclination"]
    assert rows[0]["fold_hz"].split() == ["174.74", "132.24"]
    assert rows[0]["end"] == "reached 450 Hz"
    assert "give its plane" in rows[1]["end"]
    paths = leaf_study.draw(records, tmp_path)
    drawn = {path.stem for path in paths}
    assert drawn == {"summary", "response", "contact", "history", "inclination", "chatter"}
    assert all(path.stat().st_size > 20_000 for path in paths)
    assert set(leaf_figures.chosen_pairs(records[0].response).values()) < set(range(126))
    with open(tmp_path / "chatter.csv", encoding="utf-8") as file:
        pairs = list(csv.DictReader(file))
    assert len(pairs) == 5 * 126
    for pair in pairs:
        opens = pair["status"] == "stick-separation"
        assert bool(pair["opening_ms"]) == bool(pair["impact_velocity_mm_s"]) == opens


@pytest.mark.parametrize(("override", "sentence"), [
    ("contact.friction=0.5", "unknown key contact.friction"),
    ("contact.normal_stiffness=", "contact.normal_stiffness is missing"),
    ("contact.plane=", "give its plane"),
    ("motion.front.direction=z", '"front" is no contact face'),
    ("loads.static.pressure.direction=z", "expected no direction with pressure"),
    ("geometry.fixed_axes.left_hole=w", "must be some of the letters"),
    ("damping.state=sliding", "damping.state"),
    ("harmonics.kept=[1]", "gaps, which act in harmonic 0: keep it"),
])  # fmt: skip
def test_bad_scenes_end_with_one_sentence(override, sentence, tmp_path):
    with pytest.raises(ValueError, match=sentence):
        built(tmp_path, override, "contact.inclination=1 deg")


def test_the_verdict_knows_what_a_fold_is_off_by(tmp_path):
    """The highest point is a fold, which one harmonic puts 8 % too low and a quarter too high, as in time."""
    overrides = (
        "geometry.n_column=7", "geometry.pin_column=2", 'response.frequency=["120 Hz", "180 Hz"]',
        "response.stability=false", "verdict.in_time=false",
    )  # fmt: skip
    result = pipeline.run(scene_file.read("leaf_seal_thesis", overrides), tmp_path, Progress(), judge=with_verdict)
    outcome = {row.quantity: row.relative for row in result.verdict.changes if row.refinement == "harmonics"}
    assert outcome["peak_frequency"] == pytest.approx(0.08, abs=0.015)
    assert outcome["amplitude"] == pytest.approx(0.24, abs=0.04)

"""Modes of the stuck structure with residual flexibility, against the full model and against Craig-Bampton."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array

from tribodyn.fem.part import Part
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.recovery import full_displacement
from tribodyn.hbm.linearisation import NEARLY_ALL
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.stability.exponents import stability
from tribodyn.hbm.time.stepper import Options, TimeStepper
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.residual_flexibility import clustered, residual_flexibility
from tribodyn.workflows.run import joints, modelling, part_reduction
from tribodyn.workflows.scene import scene_file

SMALL = ["geometry.n_patch=5", "geometry.n_length=2", "geometry.n_height=1", "harmonics.kept=[0, 1, 2, 3]"]
OMEGA = 2 * np.pi * 900.0
FORCES = 1e-6  # relative difference of contact forces that the reduction is held to here


def skew(n: int) -> csr_matrix:
    """(n, n) antisymmetric."""
    upper = diags_array([np.ones(n - 1)], offsets=[1])
    return csr_matrix(upper - upper.T)


@pytest.fixture(scope="module")
def beam(tmp_path_factory: pytest.TempPathFactory) -> tuple[scene_file.SceneFile, Part, np.ndarray]:
    """The beam scene, its small part, and its contact springs."""
    file = scene_file.read("beam_thesis", SMALL)
    mesh, node_sets = modelling.make_mesh(file, tmp_path_factory.mktemp("mesh"))
    part = modelling.make_part(file.mesh_scene, mesh, node_sets)
    return file, part, joints.contact_stiffness(file.scene, joints.unreduced(part))


def _balance(file: scene_file.SceneFile, model: ReducedModel, harder: float = 1.0) -> HarmonicBalance:
    built = joints.make_joints(file.scene, model)
    changed: list[Joint] = [
        replace(j, parameters=replace(j.parameters, stiffness=harder * j.parameters.stiffness)) for j in built
    ]
    basis = HarmonicBasis((0, 1, 2, 3), 100)
    return HarmonicBalance.of(model, changed, basis, joints.excite(file.scene, None), 2 * np.pi * 1000.0)


def _full(part: Part, model: ReducedModel) -> ReducedModel:
    """Every DOF of the part, dense, with the damping of the reduced model on the same shapes."""
    M = part.system.mass.toarray()
    lifted = M @ model.origin.basis
    system = SecondOrderSystem(
        M, part.system.stiffness.toarray(), lifted @ model.system.damping @ lifted.T, part.system.loads,
        part.system.outputs,
    )  # fmt: skip
    return ReducedModel(system, replace(part.interface, B=part.interface.B.toarray()))


@pytest.mark.parametrize(("harder", "modes", "clusters"), [(1.0, 60, 2), (30.0, 60, 6)])
def test_contact_forces_are_those_of_the_full_model(beam, harder: float, modes: int, clusters: int) -> None:
    """Few clusters cost products, not accuracy; springs far stiffer than the bulk cost the accuracy that is told."""
    file, part, springs = beam
    reduced = modelling.damped(
        file.scene, residual_flexibility(part.system, part.interface, harder * springs, modes, clusters=clusters)
    )
    reduced_balance, full_balance = _balance(file, reduced, harder), _balance(file, _full(part, reduced), harder)
    exact = NewtonOptions(tolerance=1e-9)
    ours, theirs = (newton.solve_from_rest(b, OMEGA, exact) for b in (reduced_balance, full_balance))
    assert ours.converged
    assert theirs.converged
    assert len(np.unique(theirs.state.cycle.status)) > 1  # some stick and some do not
    target = theirs.state.cycle.force
    limit = FORCES if harder == 1.0 else 10 * reduced_balance.compliance.error
    assert np.abs(ours.state.cycle.force - target).max() < limit * np.abs(target).max()
    forces, expected = reduced_balance.outputs(ours.state), full_balance.outputs(theirs.state)
    assert np.abs(forces - expected).max() < limit * np.abs(expected).max()
    slope = [b.frequency_slope(s.state) for b, s in ((reduced_balance, ours), (full_balance, theirs))]
    for mine, other in zip(*slope, strict=True):
        assert np.abs(mine - other).max() < 100 * limit * np.abs(other).max()
    # the field of the whole part, with what its coordinates leave out
    shifted = full_displacement(
        reduced_balance, ours.state.flat, ours.state.cycle.force.reshape(ours.state.flat.shape), OMEGA
    )
    relative = part.interface.B @ shifted
    assert np.abs(relative - ours.state.flat).max() < 1e-7 * np.abs(ours.state.flat).max()


def test_statics_are_exact_and_what_is_left_out_is_told(beam) -> None:
    """K_s^-1 between contacts, from a dense solve; the share left out is the largest eigenvalue of what the rest is."""
    _, part, springs = beam
    model = residual_flexibility(part.system, part.interface, springs, 8, clusters=3)
    flexibility, B = model.residual, part.interface.B.toarray()
    K_s = part.system.stiffness.toarray() + B.T @ (springs.ravel()[:, None] * B)
    exact = B @ np.linalg.solve(K_s, B.T)
    result = flexibility.apply(np.eye(len(B))) + flexibility.at_contact @ (
        flexibility.at_contact.T / flexibility.squares[:, None]
    )
    assert np.abs(result - exact).max() < 1e-10 * np.abs(exact).max()
    root = np.sqrt(springs.ravel())
    remaining = exact - flexibility.at_contact @ (flexibility.at_contact.T / flexibility.squares[:, None])
    assert flexibility.left_out == pytest.approx(np.linalg.eigvalsh(root[:, None] * remaining * root)[-1], rel=1e-3)
    # loads and outputs have no rest at all
    force = np.stack([*part.system.loads.values(), *part.system.outputs.values()], axis=1)
    modal = np.stack([*model.system.loads.values(), *model.system.outputs.values()], axis=1)
    shifted = np.linalg.solve(K_s, force)
    assert (
        np.abs(flexibility.shapes @ (modal / flexibility.squares[:, None]) - shifted).max()
        < 1e-8 * np.abs(shifted).max()
    )


def test_the_error_is_that_of_the_mass_left_out(beam) -> None:
    _, part, springs = beam
    omega = 2 * np.pi * 3000.0
    for modes, clusters in ((6, 1), (20, 4)):
        model = residual_flexibility(part.system, part.interface, springs, modes, clusters=clusters)
        flexibility, B = model.residual, part.interface.B.toarray()
        K_s = part.system.stiffness.toarray() + B.T @ (springs.ravel()[:, None] * B)
        exact = B @ np.linalg.solve(K_s - omega**2 * part.system.mass.toarray(), B.T)
        modal = flexibility.at_contact @ (flexibility.at_contact.T / (flexibility.squares - omega**2)[:, None])
        root = np.sqrt(springs.ravel())
        force = root[:, None] * np.random.default_rng(1).normal(size=(75, 8))
        off = (exact - modal - flexibility.apply(np.eye(len(B)))) @ force
        size = np.linalg.norm(off) / np.linalg.norm(exact @ force)
        assert 0.2 * size < flexibility.error(omega) < 20 * size


def test_what_a_solve_does_not_ask_for_is_below_its_tolerance(beam, monkeypatch: pytest.MonkeyPatch) -> None:
    """A solve ends on a bound of the residual flexibility; its state has the residual wanted with all of it, too."""
    file, part, springs = beam
    balance = _balance(file, residual_flexibility(part.system, part.interface, springs, 20, clusters=16))
    flexibility, requested = balance.model.residual, []
    assert flexibility.left_out <= NEARLY_ALL
    force = np.random.default_rng(0).normal(size=(75, 4)) * np.sqrt(springs.ravel())[:, None]
    shifted, x = flexibility.apply(force), np.random.default_rng(1).normal(size=(75, 4))
    root = np.sqrt(springs.ravel())[:, None]
    share = np.linalg.norm(root * shifted) / np.linalg.norm(root * x)
    assert (
        0.1 * flexibility.at_most(flexibility.lacking(force), x)
        < share
        < flexibility.at_most(flexibility.lacking(force), x)
    )
    one_row = np.eye(75)[:, :1]
    loose = replace(flexibility, stiffness=springs.ravel() * (1 - one_row[:, 0]))
    assert loose.at_most(loose.lacking(one_row), x[:, :1]) == np.inf
    plain = type(flexibility).apply
    monkeypatch.setattr(type(flexibility), "apply", lambda self, f: (requested.append(1), plain(self, f))[1])
    start = newton.solve_from_rest(balance, OMEGA, NewtonOptions(tolerance=1e-8)).state.x
    bounded, path = 0, parameter.of(balance).make(OMEGA)
    for omega in OMEGA * np.linspace(1.0, 1.005, 6):
        before = len(requested)
        solution = newton.solve(path, omega, start, NewtonOptions(tolerance=1e-8))
        spent = len(requested) - before
        exact = newton.relative_residual(balance.evaluate(omega, solution.state.x), balance.x_lin(omega))
        assert solution.converged
        assert exact <= solution.history[-1] <= 1e-8
        bounded += exact < solution.history[-1]
        assert spent < len(solution.history)
        start = solution.state.x
    assert bounded >= 3


def test_what_was_asked_for_is_known_of_all_that_adds_up_to_it(beam, monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns share one R, whichever harmonic they belong to; of another force the nearest sum is known."""
    file, part, springs = beam
    balance = _balance(file, residual_flexibility(part.system, part.interface, springs, 20, clusters=16))
    flexibility, rng = balance.model.residual, np.random.default_rng(0)
    left_out = flexibility.left_out
    solved: list[int] = []
    plain = type(flexibility).apply
    monkeypatch.setattr(type(flexibility), "apply", lambda self, f: (solved.append(f.shape[1]), plain(self, f))[1])
    root = np.sqrt(springs.ravel())[:, None]
    first, other = (root * rng.normal(size=(75, n)) for n in (5, 3))
    requested: list[np.ndarray] = []
    lacking, still = flexibility.lacking(first, requested), flexibility.recalled(first, requested)
    assert np.array_equal(lacking, first / root)
    assert not still.any()
    flexibility.ask(first, requested, 0.0)
    shifted, exact = flexibility.recalled(first, requested), plain(flexibility, first)
    assert np.abs(shifted - exact).max() < 1e-12 * np.abs(exact).max()
    for force in (first @ rng.normal(size=(5, 2)), other):
        lacking, shifted = flexibility.lacking(force, requested), flexibility.recalled(force, requested)
        nearby = force - root * lacking
        exact = plain(flexibility, nearby)
        assert np.abs(shifted - exact).max() < 1e-12 * np.abs(exact).max()
        assert np.abs((first / root).T @ lacking).max() < 1e-10 * np.abs(force / root).max()
    assert np.abs(lacking).max() > 0.1 * np.abs(force / root).max()
    # of forces nearly known only the direction that matters is solved for, and the bound tells what is left
    small = first + root * (1e-4 * rng.normal(size=(75, 1)) @ rng.normal(size=(1, 5)) + 1e-8 * rng.normal(size=(75, 5)))
    solved.clear()
    flexibility.ask(small, requested, 1e-6)
    lacking, shifted = flexibility.lacking(small, requested), flexibility.recalled(small, requested)
    assert solved == [1]
    assert 1e-8 < np.linalg.norm(lacking) < 1e-6
    off = root * (shifted - plain(flexibility, small))
    assert np.linalg.norm(off) < left_out * np.linalg.norm(lacking)
    flexibility.ask(small, requested, 1e-6)
    assert solved == [1]
    for size in np.logspace(-2, -8, 12):  # however near the forces are, columns stay orthonormal and the first go
        latest = first + size * root * rng.normal(size=(75, 5))
        flexibility.ask(latest, requested, 0.0)
        basis, shifted = requested[0]
        assert np.abs(basis.T @ basis - np.eye(basis.shape[1])).max() < 1e-12
        assert np.abs(flexibility.lacking(latest, requested)).max() < 1e-12 * np.abs(latest / root).max()
        exact = plain(flexibility, root * basis)
        assert np.abs(shifted - exact).max() < 1e-11 * np.abs(exact).max()
    assert basis.shape == (75, 5 * LIMITS.recalled)


def test_directions_know_what_is_recalled(beam) -> None:
    """The Jacobian of a balance with what is known of the residual flexibility, against differences."""
    file, part, springs = beam
    balance = _balance(file, residual_flexibility(part.system, part.interface, springs, 20, clusters=16))
    flexibility, requested = balance.model.residual, list[np.ndarray]()
    state = newton.solve_from_rest(balance, OMEGA).state
    flexibility.ask(state.g, requested, 0.0)
    nearby = replace(balance, remainder=lambda g: flexibility.recalled(g, requested))
    path = np.random.default_rng(0).normal(size=state.x.shape) * np.abs(state.x).max()
    high, low = (nearby.evaluate(OMEGA, state.x + h * path) for h in (1e-6, -1e-6))
    expected = (high.residual - low.residual) / 2e-6
    result, _, _ = nearby.linearise(state).solve(expected, 1e-6)
    without, _, _ = balance.linearise(state).solve(expected, 1e-6)
    exact = path.reshape(result.shape)
    off, before = (np.linalg.norm(d - exact) / np.linalg.norm(exact) for d in (result, without))
    assert off < 1e-4 < before


def test_a_curve_recalls_what_its_points_asked_for_and_a_solution_by_itself_nothing(beam) -> None:
    """What was solved before changes no bit of it: a run that goes on after a stop has not solved that."""
    file, part, springs = beam
    balance = _balance(file, residual_flexibility(part.system, part.interface, springs, 20, clusters=16))
    single = newton.solve_from_rest(balance, OMEGA)
    curve = parameter.of(balance).make(OMEGA)
    solution = newton.solve(curve, OMEGA, single.state.x)
    repeated = newton.solve(curve, OMEGA, solution.state.x)
    assert (repeated.steps, repeated.products) == (0, 0)
    assert np.array_equal(newton.solve_from_rest(balance, OMEGA).state.x, single.state.x)
    full = [natural.follow(balance, 0.9 * OMEGA, OMEGA, natural.Options(n_points=3)).contact for _ in range(2)]
    assert np.array_equal(*full)


def test_matrices_of_velocity_are_projected(beam) -> None:
    _, part, springs = beam
    M = part.system.mass
    turning = replace(part.system, damping=3.0 * M, gyroscopic=M @ skew(part.system.n_dof) @ M)
    model = residual_flexibility(turning, part.interface, springs, 5, clusters=2)
    assert np.allclose(model.system.damping, 3.0 * np.eye(model.system.n_dof), atol=1e-8)
    assert np.allclose(model.system.gyroscopic, -model.system.gyroscopic.T)
    assert np.abs(model.system.gyroscopic).max() > 0


def test_clusters_share_out_all_pairs(beam) -> None:
    _, part, springs = beam
    columns = clustered(part.interface, springs.ravel(), 4)
    assert columns.shape == (75, 12)
    assert (np.diff(columns.tocsr().indptr) == 1).all()
    assert np.allclose(columns.sum(), springs.sum())


def test_a_copy_in_another_process_makes_its_own_factor(beam) -> None:
    _, part, springs = beam
    flexibility = residual_flexibility(part.system, part.interface, springs, 4, clusters=2).residual
    force = np.random.default_rng(0).normal(size=(75, 2))
    record = pickle.loads(pickle.dumps(flexibility))
    assert np.allclose(record.apply(force), flexibility.apply(force), rtol=1e-10, atol=0)


def test_a_scene_with_thousands_of_pairs_does_without_masters(beam) -> None:
    file, _, _ = beam
    scene = scene_file.read("beam_thesis", ['reduction.method="auto"']).mesh_scene
    assert not part_reduction.without_masters(scene, part_reduction.MOST_MASTERS, False)
    assert part_reduction.without_masters(scene, part_reduction.MOST_MASTERS + 1, False)
    assert not part_reduction.without_masters(scene, part_reduction.MOST_MASTERS + 1, True)
    assert not part_reduction.without_masters(file.mesh_scene, 10**5, False)  # it says craig_bampton
    requested = scene_file.read("beam_thesis", ['reduction.method="residual_flexibility"']).mesh_scene
    assert part_reduction.without_masters(requested, 75, False)
    with pytest.raises(ValueError, match='cannot do no_turning: take "craig_bampton"'):
        part_reduction.without_masters(requested, 75, True)


def test_what_needs_every_contact_dof_says_so(beam) -> None:
    file, part, springs = beam
    model = modelling.damped(file.scene, residual_flexibility(part.system, part.interface, springs, 8, clusters=3))
    balance = _balance(file, model)
    with pytest.raises(ValueError, match=r'time integration needs .* set reduction.method = "craig_bampton"'):
        TimeStepper(balance, OMEGA, Options())
    state = newton.solve_from_rest(balance, OMEGA).state
    with pytest.raises(ValueError, match="stability needs a model that keeps every contact DOF"):
        stability(balance, state)
    with pytest.raises(scene_file.SceneError, match='method = "craig_bampton" with relative'):
        scene_file.read("beam_thesis", ['reduction.method="residual_flexibility"', "reduction.relative=true"])

"""One's own matrices by the front door: any rows, several contacts with their laws, no damping, frequencies in Hz."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

import tribodyn as td
from tribodyn import matrices as own
from tribodyn.hbm.linear.recovery import coordinates
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.reduction.matrix_files import read_matrix

MASS = np.diag([1.0, 0.8, 1.2, 0.6])
STIFFNESS = 1e5 * np.array(
    [[3.0, -1.0, 0.0, -0.2], [-1.0, 2.5, -1.0, 0.0], [0.0, -1.0, 2.2, -0.7], [-0.2, 0.0, -0.7, 1.5]]
)
RUB, STOP = np.array([1.0, -0.5, 0.0, 0.3]), np.array([[0.0, 0.2, 1.0, -1.0]])
LOADS = {"shaker": 3, "press": 2}


def structure(damping_ratio: float | None = 0.02, damping: np.ndarray | None = None) -> own.Structure:
    """A rod that rubs along one row under a constant load, and a stop along another row."""
    matrices = own.from_arrays(MASS, sp.csr_matrix(STIFFNESS), damping)
    rub = own.Contact(
        "rub",
        matrices.contact_rows(RUB, ("t1",), area=1e-4),
        "jenkins_constant",
        tangential_stiffness=2e5,
        numbers={"friction": 0.5, "normal_load": 40.0},
    )
    stop = own.Contact("stop", matrices.contact_rows(STOP, ("n",), area=1e-4, gap=1e-4), "unilateral", 0.0, 1e5)
    return own.reduce(matrices, (rub, stop), loads=LOADS, outputs={"tip": 3, "bow": RUB}, damping_ratio=damping_ratio)


def balance(made: own.Structure, force: float = 15.0) -> own.Balance:
    loads = {1: {"shaker": force}}
    return made.balance(tuple(range(10)), up_to=100.0, static={"press": 20.0}, harmonic=loads, samples=512)


def test_the_linear_ends_are_those_of_the_matrices_in_hz() -> None:
    built = structure()
    rows, springs = np.vstack([RUB, STOP]), np.diag([2e5, 1e5])
    for stuck, stiffness in ((False, STIFFNESS), (True, STIFFNESS + rows.T @ springs @ rows)):
        expected = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(MASS, stiffness)).real)) / (2 * np.pi)
        assert np.allclose(built.frequencies(4, stuck=stuck), expected, rtol=1e-10)


def test_two_laws_on_any_rows_fulfil_the_equation_of_motion() -> None:
    """M q'' + C q' + K q + W^T f(W q) = F in every harmonic kept, the contact forces marched here."""
    built = structure()
    problem = balance(built)
    cycle = problem.solve(45.0)
    assert cycle.converged
    assert cycle.frequency == pytest.approx(45.0, rel=1e-14)
    assert cycle.status[0] & 2, "the rub slips"
    assert cycle.status[1] & 4, "the stop opens"
    basis, omega = problem.problem.basis, 2 * np.pi * 45.0
    n, flat = basis.n_coeff, (-1, basis.n_coeff)
    q = coordinates(problem.problem, cycle.displacement.reshape(flat), cycle.force.reshape(flat), omega)
    t = np.arange(4096) / 4096 * 2 * np.pi
    waves = np.exp(1j * np.outer(basis.harmonics, t))
    motion = np.real(np.array(q).T @ waves)
    rub, stop = RUB @ motion, STOP[0] @ motion
    slider, shear = 0.0, np.zeros(len(t))
    for _ in range(2):
        for k, x in enumerate(rub):
            shear[k] = np.clip(2e5 * (x - slider), -20.0, 20.0)
            slider = x - shear[k] / 2e5
    pressed = 1e5 * np.maximum(stop - 1e-4, 0.0)
    contact = np.outer(RUB, shear) + np.outer(STOP[0], pressed)
    damping = np.asarray(built.model.system.damping)
    for h, amplitude in zip(basis.harmonics, q, strict=True):
        s = 1j * h * omega
        force = (2 if h else 1) * (contact @ np.exp(-1j * h * t)) / len(t)
        load = np.array([0, 0, 20.0 * (h == 0), 15.0 * (h == 1)])
        remaining = (s**2 * MASS + s * damping + STIFFNESS) @ amplitude + force - load
        assert np.abs(remaining).max() < 2e-3 * 15.0, f"harmonic {h}, {n} coefficients"
    brought, damped = np.pi * 15.0 * cycle.outputs["tip"][2], 0.0
    for h, amplitude in zip(basis.harmonics, q, strict=True):
        damped += np.pi * h * omega * np.real(amplitude.conj() @ damping @ amplitude) * h
    assert brought == pytest.approx(cycle.energy.sum() + damped, rel=1e-3)


def test_one_law_on_any_rows_agrees_with_integration_in_time() -> None:
    matrices = own.from_arrays(MASS, STIFFNESS)
    rows = np.vstack([RUB, [0.4, 0.0, -1.0, 0.2]])
    rub = own.Contact(
        "rub",
        matrices.contact_rows(rows, ("t1",), area=1.0),
        "jenkins_constant",
        4e5,
        numbers={"friction": 0.5, "normal_load": np.array([40.0, 15.0])},
    )
    reduced = own.reduce(matrices, rub, loads=LOADS, outputs={"tip": 3}, damping_ratio=0.02)
    problem = reduced.balance((1, 3, 5, 7), up_to=100.0, harmonic={1: {"shaker": 40.0}}, samples=512)
    cycle = problem.peak(30.0, 70.0)
    assert (cycle.status & 2).any()
    verification = problem.verify(cycle, steps=512)
    assert verification.outcome == CONVERGED
    assert verification.largest < 0.01
    assert problem.integrate(cycle.frequency, cycle, steps=256).frequency == pytest.approx(cycle.frequency)


@pytest.mark.parametrize("damping", [None, np.zeros((4, 4))])
def test_no_damping_at_all_is_a_structure_too(damping: np.ndarray | None) -> None:
    built = structure(None, damping)
    assert built.model.system.damping is None
    cycle = balance(built).solve(45.0)
    assert cycle.converged
    # with nothing else to take it, all the power goes into friction, but for what the sampled stop seems to do
    assert np.pi * 15.0 * cycle.outputs["tip"][2] == pytest.approx(cycle.energy.sum(), rel=1e-4)


def test_a_curve_its_stability_a_mode_and_wear_are_told_in_hz() -> None:
    problem = balance(structure())
    curve = problem.response(40.0, 70.0, points=25)
    assert str(curve.end).startswith("reached")
    assert (curve.frequency[0], curve.frequency[-1]) == pytest.approx((40.0, 70.0))
    marks = problem.stability(curve)
    assert marks.stable[:3].all()
    assert all(40.0 < turn.frequency < 70.0 for turn in marks.bifurcations)
    peak = problem.peak(40.0, 70.0, "tip")
    assert peak.amplitude("tip") >= curve.amplitude("tip").max() * (1 - 1e-6)
    assert 40.0 < peak.frequency < 70.0
    backbone = problem.nonlinear_mode(1e-6, 1e-3, output="tip", points=10)
    assert backbone.frequency[0] == pytest.approx(backbone.reference_omega / (2 * np.pi), rel=1e-3)
    worn = problem.wear({"rub": own.wear_law("energy", coefficient=1e-12)}, at=45.0, step=1e-6, max_steps=2)
    assert worn.frequency == pytest.approx(45.0)
    assert (worn.depth[-1, 0] > 0, worn.depth[-1, 1]) == (True, 0.0)
    assert worn.depth[-1, 0] == pytest.approx(1e-12 * worn.work[:-1, 0].sum() / 1e-4, rel=1e-6)


def test_rows_that_pick_dofs_are_the_contact_of_those_dofs() -> None:
    matrices = own.from_arrays(MASS, STIFFNESS)
    picked = np.zeros((2, 4))
    picked[[0, 1], [0, 3]], picked[[0, 1], [1, 2]] = 1.0, -1.0
    item = matrices.contact([[0], [3]], [[1], [2]], components=("n",), area=2.0)
    other = matrices.contact_rows(picked, ("n",), area=2.0)
    assert np.array_equal(item.B.toarray(), other.B.toarray())
    assert np.array_equal(item.area, other.area)


@pytest.mark.parametrize(("call", "words"), [
    (lambda m: m.contact_rows(np.ones((1, 3)), ("n",), area=1.0), "one of the 4 DOFs"),
    (lambda m: m.contact_rows(np.ones((3, 4)), ("t1", "n"), area=1.0), "give 2 for each pair"),
    (lambda m: m.contact_rows(np.zeros((1, 4)), ("n",), area=1.0), "can never move"),
    (lambda m: m.contact_rows(np.full((1, 4), np.nan), ("n",), area=1.0), "not finite"),
    (lambda m: m.contact_rows(RUB, ("n", "t1"), area=1.0), "in this order"),
    (lambda m: own.from_arrays(MASS, STIFFNESS[:3, :3]), "4 rows but the stiffness matrix has 3"),
    (lambda m: own.from_arrays(MASS, np.triu(STIFFNESS)), "one triangle only"),
    (lambda m: own.reduce(m, (), loads=LOADS, outputs={"tip": 3}), "at least one contact"),
    (lambda m: structure(0.01, np.eye(4)), "hold a damping matrix"),
    (lambda m: balance(structure()).response(1, 2, nonsense=3), "nonsense"),
    (lambda m: balance(structure()).response(1, 2, method="magic"), "no continuation 'magic'"),
    (lambda m: balance(structure()).peak(1, 2, "toe"), "no output 'toe': there are tip, bow"),
    (lambda m: balance(structure()).wear(own.wear_law("energy", coefficient=1.0), at=50.0), "needs either step"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(call, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call(own.from_arrays(MASS, STIFFNESS))


@pytest.mark.parametrize(("body", "words"), [
    ("coordinate real general\n2 2 1\n1 1 1.0D3\n", "not written as"),  # scipy reads 1.0
    ("array real general\n2 2\n1\n2\n3\n", "4 entries"),
    ("array real symmetric\n2 2\n1\n2\n3\n4\n", "3 entries"),
    ("coordinate real general\n2 2 2\n1 1 1.0\n3 2 2\n", "broken Matrix Market"),
    ("coordinate complex general\n2 2 1\n1 1 1 2\n", "real numbers are needed"),
    ("coordinate real general\n2 2 1\n1 1 nan\n", "not finite"),
])  # fmt: skip
def test_a_matrix_market_file_that_is_not_what_it_says_is_refused(tmp_path: Path, body: str, words: str) -> None:
    (tmp_path / "m.mtx").write_text(f"%%MatrixMarket matrix {body}")
    with pytest.raises(ValueError, match=words):
        read_matrix(tmp_path / "m.mtx")


def test_the_example_of_the_front_door_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = (td.__doc__ or "").splitlines()
    first = next(i for i, line in enumerate(lines) if "matrices.read" in line)
    last = next(i for i, line in enumerate(lines) if "curve.amplitude" in line)
    np.savez(tmp_path / "part.npz", M=MASS[:3, :3], K=STIFFNESS[:3, :3])
    monkeypatch.chdir(tmp_path)
    exec("\n".join(line.strip() for line in lines[first : last + 1]), {"td": td})


def test_a_written_matrix_comes_back(tmp_path: Path) -> None:
    scipy.io.mmwrite(tmp_path / "k.mtx", sp.coo_matrix(STIFFNESS), comment="with a D in it\nand two lines")
    assert np.array_equal(read_matrix(tmp_path / "k.mtx")[0].toarray(), STIFFNESS)

"""Matrices from other programs: every format gives the same structure; what cannot be is refused in one sentence."""

import itertools

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import scipy.sparse as sp
from pyyeti.nastran import bulk, op4

from tribodyn import matrices as own
from tribodyn.reduction.foreign import ForeignMatrices, from_arrays, read_matrices, reduced_model
from tribodyn.reduction.matrix_files import read_array, read_matrix, variables
from tribodyn.reduction.nastran_matrix import read_op4

N_NODE = 5
LABELS = [(10 * node + 7, component) for node in range(N_NODE) for component in (1, 2, 3)]


def structure():
    """Five nodes with three components in a chain: symmetric, with entries of many sizes."""
    rng = np.random.default_rng(3)
    n = 3 * N_NODE
    element = rng.normal(size=(n, n)) * (abs(np.subtract.outer(np.arange(n), np.arange(n))) < 6)
    stiffness = element @ element.T * 1e7 + 1e5 * np.eye(n)
    mass = np.diag(rng.uniform(0.1, 2.0, n)) + 0.01 * np.eye(n, k=1) + 0.01 * np.eye(n, k=-1)
    return mass, stiffness


MASS, STIFFNESS = structure()


def fortran(value):
    return f"{value:25.15E}".replace("E", "D")


def write_harwell_boeing(path, matrix, kind, per_line=1, right_hand_side=False):
    """Lower triangle for RSA, columns for RUA, in the layout of HBMAT: one number a line, D exponents."""
    columns = sp.csc_matrix(np.tril(matrix) if kind == "RSA" else matrix)
    blocks = [
        [f"{value:14d}" for value in columns.indptr + 1],
        [f"{value:14d}" for value in columns.indices + 1],
        [fortran(value) for value in columns.data],
    ]
    if right_hand_side:
        blocks.append([fortran(0.0)] * len(matrix))
    lines = [["".join(block[k : k + per_line]) for k in range(0, len(block), per_line)] for block in blocks]
    counts = [len(block) for block in lines] + [0] * (4 - len(lines))
    head = [
        f"{'Stiffness matrix from the test':72s}{'K':8s}",
        "".join(f"{count:14d}" for count in [sum(counts), *counts]),
        f"{kind:14s}{len(matrix):14d}{len(matrix):14d}{columns.nnz:14d}{0:14d}",
        f"{f'({per_line}I14)':16s}{f'({per_line}I14)':16s}{f'(1P,{per_line}E25.15)':20s}{f'({per_line}E25.15)':20s}",
    ]
    if right_hand_side:
        head.append(f"F{len(matrix):27d}{0:14d}")
    path.write_text("\n".join(head + [line for block in lines for line in block]) + "\n")


def write_abaqus(path, matrix, labels=LABELS, triangle=True, extra=()):
    lines = ["** made by the test"]
    for i, (node_i, dof_i) in enumerate(labels):
        for j, (node_j, dof_j) in enumerate(labels):
            if matrix[i, j] and (j <= i or not triangle):
                lines.append(f"{node_i},{dof_i}, {node_j},{dof_j}, {matrix[i, j]:.17e}")
    path.write_text("\n".join([*lines, *extra]) + "\n")


def from_npz(folder):
    np.savez(folder / "model.npz", M=MASS, K=STIFFNESS)
    return read_matrices(folder / "model.npz")


def from_sparse_npz(folder):
    sp.save_npz(folder / "m.npz", sp.csr_matrix(MASS))
    sp.save_npz(folder / "k.npz", sp.csc_matrix(STIFFNESS))
    return read_matrices(mass=folder / "m.npz", stiffness=folder / "k.npz")


def from_matrix_market(folder):
    scipy.io.mmwrite(folder / "m.mtx", sp.coo_matrix(MASS), symmetry="symmetric")
    scipy.io.mmwrite(folder / "k.mtx", STIFFNESS)
    return read_matrices(mass=folder / "m.mtx", stiffness=str(folder / "k.mtx"))


def from_matlab(folder):
    scipy.io.savemat(folder / "model.mat", {"Mred": MASS, "K": sp.csc_matrix(STIFFNESS), "note": "text"})
    return read_matrices(folder / "model.mat", names={"mass": "Mred"})


def from_matlab_73(folder):
    columns = sp.csc_matrix(STIFFNESS)
    with h5py.File(folder / "model.mat", "w") as file:
        file["M"] = MASS.T
        group = file.create_group("K")
        group.attrs["MATLAB_sparse"] = np.uint64(len(STIFFNESS))
        group["data"], group["ir"], group["jc"] = columns.data, columns.indices, columns.indptr
    return read_matrices(folder / "model.mat")


def from_ansys(folder):
    write_harwell_boeing(folder / "m.matrix", MASS, "RSA")
    write_harwell_boeing(folder / "k.matrix", STIFFNESS, "RSA", right_hand_side=True)
    names = ("UX", "UY", "UZ")
    rows = [f"{k + 1:14d}{node:14d}   {names[c - 1]}" for k, (node, c) in enumerate(LABELS)]
    (folder / "k.mapping").write_text("\n".join(["   Matrix Eqn    Node   DOF", *rows]))
    return read_matrices(mass=folder / "m.matrix", stiffness=folder / "k.matrix", mapping=folder / "k.mapping")


def from_ansys_unsymmetric(folder):
    write_harwell_boeing(folder / "m.matrix", MASS, "RUA", per_line=3)
    write_harwell_boeing(folder / "k.matrix", STIFFNESS, "RUA", per_line=2)
    return read_matrices(mass=folder / "m.matrix", stiffness=folder / "k.matrix")


def from_abaqus(folder):
    write_abaqus(folder / "m_MASS1.mtx", MASS)
    write_abaqus(folder / "k_STIF1.mtx", STIFFNESS, triangle=False)
    return read_matrices(mass=folder / "m_MASS1.mtx", stiffness=folder / "k_STIF1.mtx")


def from_abaqus_coordinate(folder):
    for name, matrix in (("m", MASS), ("k", STIFFNESS)):
        lower = sp.coo_matrix(np.tril(matrix))
        table = np.column_stack([lower.row + 1, lower.col + 1, lower.data])
        np.savetxt(folder / name, table, fmt=["%d", "%d", "%.17e"])
    return read_matrices(mass=folder / "m", stiffness=folder / "k")


def from_op4(folder):
    op4.write(str(folder / "part.op4"), {"maax": MASS, "kaax": STIFFNESS})
    return read_matrices(folder / "part.op4")


def from_op4_text(folder):
    for name, matrix in (("m", MASS), ("k", STIFFNESS)):
        op4.write(str(folder / f"{name}.op4"), {f"{name}red": matrix}, binary=False, digits=16, sparse="bigmat")
    rows = [f"{k + 1} {node} {c}" for k, (node, c) in enumerate(LABELS)]
    (folder / "rows.txt").write_text("\n".join(rows))
    return read_matrices(mass=folder / "m.op4", stiffness=folder / "k.op4", mapping=folder / "rows.txt")


def with_dmig(folder, mass=MASS, labels=LABELS):
    """A punch file as an external superelement has it; 16 columns keep ten digits."""
    rows = pd.MultiIndex.from_tuples(labels)
    frames = {name: pd.DataFrame(m, rows, rows) for name, m in (("MAAX", mass), ("KAAX", STIFFNESS))}
    bulk.wtdmig(str(folder / "part.pch"), frames)
    return read_matrices(folder / "part.pch")


READERS = [
    from_npz, from_sparse_npz, from_matrix_market, from_matlab, from_matlab_73, from_ansys, from_ansys_unsymmetric,
    from_abaqus, from_abaqus_coordinate, from_op4, from_op4_text,
]  # fmt: skip


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.__name__)
def test_every_format_gives_the_same_structure(reader, tmp_path):
    matrices = reader(tmp_path)
    np.testing.assert_allclose(matrices.mass.toarray(), MASS, rtol=1e-14)
    np.testing.assert_allclose(matrices.stiffness.toarray(), STIFFNESS, rtol=1e-14)
    assert (matrices.stiffness != matrices.stiffness.T).nnz == 0
    assert matrices.damping is None
    if reader in (from_ansys, from_abaqus, from_op4_text):
        assert matrices.labels == tuple(LABELS)
        assert matrices.dof((27, "UY")) == 7
        assert [matrices.dof((node, axis)) for node in (47, 7) for axis in (1, 2, 3)] == [12, 13, 14, 0, 1, 2]


def test_op4_is_read_bit_for_bit_as_another_program_writes_it(tmp_path):
    rng = np.random.default_rng(1)
    sparse = rng.normal(size=(7, 7)) * (rng.random((7, 7)) < 0.4)
    expected = {"A": sparse + sparse.T, "B": rng.normal(size=(7, 3)), "Z": np.zeros((3, 3)), "C": sparse * (1 - 2j)}
    for binary, kind, order in itertools.product((True, False), ("dense", "bigmat", "nonbigmat"), "<>"):
        op4.write(str(tmp_path / "a.op4"), expected, binary=binary, endian=order, sparse=kind, digits=16)
        read = read_op4(tmp_path / "a.op4")
        assert all(np.array_equal(read[name].toarray(), matrix) for name, matrix in expected.items()), (binary, kind)
    assert read_array(tmp_path / "a.op4", "B").shape == (7, 3)


def test_dmig_keeps_grid_points_components_and_scalar_points(tmp_path):
    labels = [*LABELS[:-1], (900, 0)]
    matrices = with_dmig(tmp_path, labels=labels)
    assert matrices.labels == tuple(labels)
    assert matrices.dof((900, 0)) == 14
    np.testing.assert_allclose(matrices.stiffness.toarray(), STIFFNESS, rtol=1e-9, atol=1e-9 * STIFFNESS.max())
    theirs = bulk.rddmig(str(tmp_path / "part.pch"))["kaax"]
    assert np.array_equal(matrices.stiffness.toarray(), theirs.to_numpy())
    free = "DMIG,K,0,6,1,0,,,2\nDMIG,K,1,1,,1,1,4.0,,+a\n+a,2,3,-1.5+0\nDMIG,K,2,3,,2,3,2.D0\n"
    small = "".join(f"{w:8s}" for w in ["DMIG", "M", "1", "1", "", "1", "1", "2.0"]) + "\n"
    small = (
        "DMIG    M              0       6       1\n"
        + small
        + "DMIG    M              2       3               2       3      3.\n"
    )
    (tmp_path / "two.bdf").write_text("$ a comment\n" + free + small + "ENDDATA\n")
    repeated = read_matrices(tmp_path / "two.bdf")
    assert repeated.labels == ((1, 1), (2, 3))
    assert repeated.stiffness.toarray().tolist() == [[4, -1.5], [-1.5, 2]]
    assert repeated.mass.diagonal().tolist() == [2, 3]


def test_a_model_of_another_program_runs_to_its_response(tmp_path):
    """Written by pyYeti: the response with an open contact is the linear one by hand."""
    matrices = from_op4_text(tmp_path)
    pad = own.Contact("pad", matrices.contact([[(7, "x")]], area=1.0, gap=1.0), "unilateral", 0.0, 1e7)
    reduced = own.reduce(matrices, pad, loads={"shaker": (47, 1)}, outputs={"tip": (47, "z")}, damping_ratio=0.02)
    balance = reduced.balance((0, 1), up_to=400.0, harmonic={1: {"shaker": 2.0}})
    system = reduced.model.system
    for frequency in (100.0, 350.0):
        omega = 2 * np.pi * frequency
        Z = STIFFNESS - omega**2 * MASS + 1j * omega * np.asarray(system.damping)
        assert balance.solve(frequency).amplitude("tip") == pytest.approx(2 * abs(np.linalg.inv(Z)[14, 12]), rel=1e-8)


def test_facts_of_a_free_and_of_a_held_structure():
    assert grounded().facts().n_rigid == 0
    chain = 1e6 * (2 * np.eye(N_NODE) - np.eye(N_NODE, k=1) - np.eye(N_NODE, k=-1))
    chain[0, 0] = chain[-1, -1] = 1e6
    free, mass = np.kron(chain, np.eye(3)), np.kron(np.diag([0.5, 1, 1, 1, 0.5]), np.eye(3))
    computed = from_arrays(mass, free, labels=tuple(LABELS)).facts()
    assert computed.n_rigid == 3
    assert computed.mass == pytest.approx((4.0, 4.0, 4.0))
    assert "3 rigid-body modes" in computed.remarks[0]
    mass[0, 0] = 0.1
    assert any("rows are missing" in r for r in from_arrays(mass, free, labels=tuple(LABELS)).facts().remarks)
    assert any("tonnes" in r for r in from_arrays(mass / 1e6, free / 1e6, labels=tuple(LABELS)).facts().remarks)


def test_harwell_boeing_agrees_with_scipy(tmp_path):
    scipy.io.hb_write(tmp_path / "k.rua", sp.csc_matrix(STIFFNESS))
    matrix, _ = read_matrix(tmp_path / "k.rua")
    theirs = scipy.io.hb_read(tmp_path / "k.rua", spmatrix=True)
    np.testing.assert_allclose(matrix.toarray(), theirs.toarray(), rtol=1e-15)


def test_harwell_boeing_fields_that_touch(tmp_path):
    """Fortran may leave no blank between fields: here 4-wide indices and values of full width."""
    head = "title\n4 1 1 2 0\nRSA 2 2 3 0\n(3I4) (3I4) (2E10.3)\n"
    (tmp_path / "k").write_text(head + "   1   3   4\n   1   2   2\n-2.000E+01-1.000E+00\n 3.000E+01\n")
    assert read_matrix(tmp_path / "k")[0].toarray().tolist() == [[-20, -1], [-1, 30]]


def test_fortran_numbers_without_exponent_letter(tmp_path):
    write_harwell_boeing(tmp_path / "k", STIFFNESS, "RSA")
    text = (tmp_path / "k").read_text()
    first = fortran(STIFFNESS[0, 0])
    (tmp_path / "k").write_text(text.replace(first, f"{'1.25-103':>25s}"))
    assert read_matrix(tmp_path / "k")[0][0, 0] == 1.25e-103


def test_damping_scale_and_massless_dofs(tmp_path):
    """Abaqus in N-mm-t-s: a mass file without some DOFs, and constrained ones with 1e36 on the diagonal."""
    massless = LABELS[4]
    rows = [k for k, label in enumerate(LABELS) if label != massless]
    write_abaqus(tmp_path / "m", MASS[np.ix_(rows, rows)] / 1e3, [LABELS[k] for k in rows])
    fixed = ("999,1,999,1,1.0e+36",)
    write_abaqus(tmp_path / "k", STIFFNESS / 1e3, extra=fixed)
    write_abaqus(tmp_path / "c", 1e-5 * STIFFNESS / 1e3)
    matrices = read_matrices(mass=tmp_path / "m", stiffness=tmp_path / "k", damping=tmp_path / "c", scale=1e3)
    assert matrices.n_dof == 3 * N_NODE
    assert len(matrices.notes) == 1
    assert "1 constrained" in matrices.notes[0]
    assert matrices.mass[4, 4] == 0
    np.testing.assert_allclose(matrices.damping.toarray(), 1e-5 * STIFFNESS, rtol=1e-13)
    with pytest.raises(ValueError, match="node 999 has no free component 1"):
        matrices.dof((999, 1))


def grounded() -> ForeignMatrices:
    return ForeignMatrices(sp.csr_matrix(MASS), sp.csr_matrix(STIFFNESS), labels=tuple(LABELS))


def test_frequency_response_from_matrices(tmp_path):
    """The example of the docstring, with the linear response of a stuck contact against a dense solve by hand."""
    np.savez(tmp_path / "model.npz", M=MASS, K=STIFFNESS, C=1e-6 * STIFFNESS)
    matrices = read_matrices(tmp_path / "model.npz")
    system = matrices.system(loads={"shaker": 2, "pair": {0: 2.0, 3: -1.0}}, outputs={"tip": 14})
    contact = matrices.contact([[3, 4, 5], [6, 7, 8]], components=("t1", "t2", "n"), area=1e-5)
    model = reduced_model(system, contact)
    assert isinstance(model.system.stiffness, np.ndarray)
    assert contact.area.sum() == pytest.approx(1e-5)
    stuck, B = contact.stiffness(2e7, 3e7), np.asarray(model.interface.B)
    omega = 300.0
    impedance = model.system.stiffness + B.T @ np.diag(stuck.ravel()) @ B - omega**2 * model.system.mass
    impedance = impedance + 1j * omega * model.system.damping
    response = model.system.outputs["tip"] @ np.linalg.solve(impedance, model.system.loads["shaker"])
    by_hand = STIFFNESS * (1 + 1e-6j * omega) - omega**2 * MASS
    by_hand[range(3, 9), range(3, 9)] += np.tile([1e7, 1e7, 1.5e7], 2)
    assert response == pytest.approx(np.linalg.inv(by_hand)[14, 2], rel=1e-10)
    assert model.system.loads["pair"] @ np.arange(15) == -3.0
    with pytest.raises(ValueError, match="no full field"):
        model.reconstruct(np.zeros(15))


def test_pairs_with_frames_close_when_body_1_moves_along_the_normal():
    matrices = grounded()
    normal, slide = np.array([0.0, 0.6, -0.8]), np.array([1.0, 0.0, 0.0])
    first, second = ([[matrices.dof((n, c)) for c in (1, 2, 3)] for n in nodes] for nodes in ((7, 17), (27, 37)))
    contact = matrices.contact(
        first, second, area=[1e-6, 3e-6], components=("t1", "t2", "n"), normal=normal, t1=slide, gap=-2e-6
    )
    for frame in contact.frames:
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(contact.frames) == pytest.approx([1, 1])
    q = np.zeros(15)
    q[first[1]], q[second[1]] = 3e-6 * normal, -1e-6 * normal + 5e-6 * slide
    np.testing.assert_allclose(contact.B @ q, [0, 0, 0, -5e-6, 0, 4e-6], atol=1e-20)
    assert contact.area.tolist() == [1e-6, 3e-6]
    assert contact.gap.tolist() == [-2e-6, -2e-6]
    only_normal = matrices.contact(first, second, area=1.0, components=("n",), normal=normal)
    assert (only_normal.B @ q)[1] == pytest.approx(4e-6)


def test_signs_and_single_component():
    contact = grounded().contact([[2], [5]], [[8], [11]], area=1.0, signs=[-1])
    assert contact.B.toarray()[0, [2, 8]].tolist() == [-1, 1]
    assert contact.components == ("n",)


def bad_npz(folder, **arrays):
    np.savez(folder / "bad.npz", **arrays)
    return read_matrices(folder / "bad.npz")


def with_entry(value):
    matrix = STIFFNESS.copy()
    matrix[2, 1] = value
    return matrix


DMIG = "DMIG,K,0,{form},{kind},0,,,2\nDMIG,M,0,6,1\nDMIG,M,1,1,,1,1,1.0\nDMIG,K,1,1,,1,1,{value}\n"


def named(folder, name, content):
    (folder / name).write_text(content)
    return read_matrices(folder / name)


def text(folder, content):
    (folder / "k").write_text(content)
    return read_matrices(mass=folder / "k", stiffness=folder / "k")


@pytest.mark.parametrize(("call", "words"), [
    (lambda f: bad_npz(f, M=MASS, K=STIFFNESS[:, :4]), "stiffness matrix is 15 x 4: it must be square"),
    (lambda f: bad_npz(f, M=MASS, K=with_entry(1.01 * STIFFNESS[2, 1])), r"not symmetric: entry \((2, 1|1, 2)\)"),
    (lambda f: bad_npz(f, M=MASS, K=np.tril(STIFFNESS)), "one triangle only"),
    (lambda f: bad_npz(f, M=MASS[:9, :9], K=STIFFNESS), "mass matrix has 9 rows but the stiffness matrix has 15"),
    (lambda f: bad_npz(f, M=-MASS, K=STIFFNESS), "exchanged"),
    (lambda f: bad_npz(f, M=MASS, K=with_entry(np.nan)), "not finite"),
    (lambda f: bad_npz(f, M=MASS, K=STIFFNESS + 1j), "real numbers"),
    (lambda f: bad_npz(f, M=MASS, K=0 * STIFFNESS), "is zero"),
    (lambda f: bad_npz(f, M=MASS, Kred=STIFFNESS), "no variable 'K': it holds Kred, M"),
    (lambda f: read_matrices(f / "none.npz"), "no file"),
    (lambda f: named(f, "part.sub", "any"), r"part.sub is in a format .*EXPORT, K, MMF"),
    (lambda f: named(f, "part.op2", "any"), "DMIGPCH"),
    (lambda f: named(f, "part.op4", "      31      25  what"), "no OUTPUT4 file"),
    (lambda f: named(f, "part.pch", DMIG.format(form=2, kind=1, value="1.0")), "form 2: only square"),
    (lambda f: named(f, "part.pch", DMIG.format(form=6, kind=3, value="1.0")), "type 3: real numbers"),
    (lambda f: named(f, "part.pch", DMIG.format(form=6, kind=1, value="x1")), "not numbers"),
    (lambda f: named(f, "part.pch", DMIG.format(form=6, kind=1, value="1.0\n+,1,1,2.0")), "an entry twice"),
    (lambda f: named(f, "part.pch", "DMIG,K,1,1,,1,1,1.\n"), "before its first entry"),
    (lambda f: read_matrices(mass=f / "m"), "no stiffness matrix is given"),
    (lambda f: read_matrices(f / "x.npz", names={"massa": "M"}), "the keys are mass, stiffness and damping"),
    (lambda f: text(f, "hello\nworld\n"), "no format known"),
    (lambda f: text(f, "%%MatrixMarket matrix coordinate real general\n2 2 9\n1 1 1.0\n"), "broken Matrix Market"),
    (lambda f: text(f, "1,1,1,1,2.0\n1,1,oops\n"), "not numbers"),
    (lambda f: text(f, "1,1,1.5,1,2.0\n"), "not whole"),
    (lambda f: text(f, "1,1,nan,1,2.0\n"), "no format known"),
    (lambda f: text(f, "1,1,1e300,1,2.0\n"), "not whole"),
    (lambda f: text(f, "t\n1 1 1 1\nCSA 2 2 3 0\n(1I4) (1I4) (1E9.1)\n"), "type CSA"),
    (lambda f: text(f, "t\n9 3 3 3\nRSA 2 2 3 0\n(1I4) (1I4) (1E9.1)\n1\n3\n"), "ends after 6 of 13 lines"),
    (lambda _: grounded().dof(15), "DOF 15 is outside 0 .. 14"),
    (lambda _: grounded().dof(-1), "outside"),
    (lambda _: grounded().dof((7, "phi")), "component 'phi' is unknown"),
    (lambda _: grounded().dof((8, 1)), "node 8 has no free component 1"),
    (lambda _: ForeignMatrices(grounded().mass, grounded().stiffness).dof((7, 1)), "no labels"),
    (lambda _: grounded().system(loads={"f": np.ones(3)}, outputs={}), "load f has shape"),
    (lambda _: grounded().contact([[3]], area=1.0, components=("n", "t1")), "in this order"),
    (lambda _: grounded().contact([[3, 4]], area=1.0), "rows of 1 DOFs"),
    (lambda _: grounded().contact([[3]], [[3]], area=1.0), "same DOF on both bodies"),
    (lambda _: grounded().contact([[3]], [[4], [5]], area=1.0), "meet in pairs"),
    (lambda _: grounded().contact([[3]], area=0.0), "not positive"),
    (lambda _: grounded().contact([[3, 4, 5]], area=1.0, normal=[0, 0, 0]), "normal is zero"),
    (lambda _: grounded().contact([[3, 4, 5]], area=1.0, normal=[0, 0, 1], t1=[0, 0, 2]), "along the contact normal"),
    (lambda _: grounded().contact([[3]], area=1.0, signs=[2]), "signs"),
])  # fmt: skip
def test_bad_files_and_dofs_are_refused_in_one_sentence(call, words, tmp_path):
    with pytest.raises(ValueError, match=words) as refusal:
        call(tmp_path)
    assert "\n" not in str(refusal.value)


COUNTED = [
    from_npz, from_sparse_npz, from_matrix_market, from_matlab, from_matlab_73, from_ansys_unsymmetric, from_op4,
    from_op4_text,
]  # fmt: skip


@pytest.mark.parametrize("reader", COUNTED, ids=lambda reader: reader.__name__)
def test_a_file_that_ends_early_is_refused_in_one_sentence(reader, tmp_path):
    """Of the formats that say how many entries there are; nobody can tell where the last number lost its end."""
    reader(tmp_path)
    for path in (path for path in tmp_path.iterdir() if path.suffix not in (".mapping", ".txt")):
        full = path.read_bytes()
        names = variables(path) or [None]
        for share in np.linspace(0.01, 0.95, 40):
            path.write_bytes(full[: int(share * len(full))])
            with pytest.raises(ValueError, match=path.name) as refusal:
                [read_matrix(path, name) for name in names]
            assert "\n" not in str(refusal.value), share


@pytest.mark.parametrize("storage", ["coordinate", "array"])
@pytest.mark.parametrize("symmetry", ["general", "symmetric", "skew-symmetric"])
def test_matrix_market_is_read_as_scipy_writes_it(storage, symmetry, tmp_path):
    square = np.arange(25.0).reshape(5, 5)
    matrix = {"general": square[:, :3], "symmetric": square + square.T, "skew-symmetric": square - square.T}[symmetry]
    stored = sp.coo_matrix(matrix) if storage == "coordinate" else matrix
    scipy.io.mmwrite(tmp_path / "m.mtx", stored, symmetry=symmetry)
    np.testing.assert_array_equal(read_matrix(tmp_path / "m.mtx")[0].toarray(), matrix)

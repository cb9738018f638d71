"""The columns of tribodyn: harmonic balance by arc length, and integration in time of the same problem."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby, pairwise
from pathlib import Path
from time import process_time

import numpy as np

import tribodyn as td
from proof.bench.problem import FOLDER, Element, Problem
from proof.bench.record import CURVE, POINT, Record, Row
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.refusal import Refusal, SolverFailure

HZ = 2 * np.pi
SPRINGS = 1000.0  # of a set-valued contact in the balance, over the stiffness of the structure there
STEPS = 2048  # of a period in time
LAWS = {"cubic": "cubic_spring", "stop": "unilateral", "friction": "jenkins_constant"}
Motions = list[tuple[td.matrices.Cycle, float]]


def _law(element: Element) -> str:
    if element.numbers["belt"]:
        return str(FOLDER / "belt_friction.py")
    return LAWS.get(element.law, "coulomb_planar" if len(element.components) == 3 else "jenkins")


def balance_of(problem: Problem) -> td.matrices.Balance:
    """The harmonic balance of a problem."""
    matrices, contacts = td.matrices.from_arrays(problem.mass, problem.stiffness, problem.damping), []
    for law, group in groupby(sorted(problem.elements, key=_law), key=_law):
        elements = list(group)
        values = {
            key: np.array([e.numbers[key] for e in elements]) for key in ("gap", "k3", "limit", "friction", "belt")
        }
        numbers = {
            "cubic_spring": {"cubic": values["k3"]}, "unilateral": {},
            "jenkins_constant": {"friction": 1.0, "normal_load": values["limit"]},
            "belt_friction": {"friction": 1.0, "normal_load": values["limit"], "speed": values["belt"]},
        }.get(Path(law).stem, {"friction": values["friction"]})  # fmt: skip
        tangential, normal = (
            np.array([_springs(problem, e.rows[at], e.numbers[key]) for e in elements])
            for key, at in (("kt", 0), ("kn", -1))
        )
        rows, components = np.vstack([e.rows for e in elements]), elements[0].components
        face = matrices.contact_rows(rows, components, area=float(len(elements)), gap=values["gap"])
        contacts.append(td.matrices.Contact(Path(law).stem, face, law, tangential, normal, numbers))
    loads = {f"{part} {h}": pair[i] for h, pair in problem.loads.items() for i, part in enumerate(("cos", "sin"))}
    structure = td.matrices.reduce(
        matrices, contacts, loads={"static": problem.static, **loads}, outputs={"output": problem.output}
    )
    return structure.balance(
        problem.orders, up_to=1.01 * max(problem.curve) / HZ, samples=problem.samples,
        harmonic={h: {f"cos {h}": 1.0, f"sin {h}": -1j} for h in problem.loads},
        static={"static": 1.0} if problem.static.any() else None,
    )  # fmt: skip


def _springs(problem: Problem, row: np.ndarray, stiffness: float) -> float:
    if np.isfinite(stiffness):
        return stiffness
    return float(SPRINGS / (row @ np.linalg.lstsq(problem.stiffness, row, rcond=None)[0]))


def in_frequency(problem: Problem, balance: td.matrices.Balance) -> tuple[Record, Motions]:
    """The column of the balance, and the motions behind its points with their stability."""
    inner, begin, (low, high) = balance.problem, problem.curve[0], problem.curve
    options = arc_length.Options(bounds=(low, high), newton=balance.newton)
    if problem.start is not None:
        begin, rows = problem.start[0], np.asarray(inner.model.interface.B)
        guess = np.zeros((len(rows), inner.basis.n_coeff))
        guess[:, inner.basis.order == 1] = np.column_stack([rows @ part for part in problem.start[1:]])
        options = replace(options, guess=inner.shaped(guess))
    arc_length.follow(inner, begin, high, replace(options, max_points=3))  # compiles outside the clock
    clock = process_time()
    branch = arc_length.follow(inner, begin, high, options)
    seconds = process_time() - clock
    stable = np.full(len(branch.omega), np.nan) if problem.is_rigid else balance.stability(branch).stable
    on_belts = any(element.numbers["belt"] for element in problem.elements)
    energy = np.where(on_belts, np.nan, branch.energy)  # on the structure alone
    curve = zip(
        branch.omega, branch.amplitude("output"), _mean(branch.response[:, 0]),
        np.angle(branch.fundamental("output")), energy, stable, branch.converged, strict=True,
    )  # fmt: skip
    rows = [Row(CURVE, w, a, m, p, e, stable=float(s)) for w, a, m, p, e, s, solved in curve if solved]
    motions = Motions()
    for omega in problem.points:
        count = len(motions)
        for i, (a, b) in enumerate(pairwise(branch.omega)):
            if (a - omega) * (b - omega) <= 0 < abs(a - b):
                x = branch.contact[i] + (omega - a) / (b - a) * (branch.contact[i + 1] - branch.contact[i])
                solution = newton.solve(inner, omega, inner.shaped(x), balance.newton)
                motions.append((td.matrices.Cycle(inner, solution.state, solution.outcome), float(stable[i])))
        if len(motions) == count:  # the curve does not come by
            motions.append((balance.solve(omega / HZ), np.nan))
    motions = [(cycle, is_stable) for cycle, is_stable in motions if cycle.converged]
    for cycle, is_stable in motions:
        q = cycle.outputs["output"]
        phase, mean = np.angle(q[len(q) % 2] - 1j * q[len(q) % 2 + 1]), float(_mean(q))
        force = inner.history(cycle.state)[1]
        energy, shares = _work(problem, cycle.energy, force, cycle.state.omega), _shares(balance, force)
        row = Row(POINT, cycle.state.omega, cycle.amplitude("output"), mean, phase, energy, *shares, is_stable)
        rows += [] if row.is_in(rows) else [row]
    settings = f"orders {', '.join(map(str, problem.orders))}; {problem.samples} samples; {len(branch.omega)} points"
    settings += f"; springs {SPRINGS:g} times as stiff as the structure" if problem.is_rigid else ""
    note = "" if branch.arrived or branch.ended is BranchEnd.CLOSED else str(branch.end)
    return Record(_head(problem, settings, seconds, note), tuple(rows)), motions


def _work(problem: Problem, energy: np.ndarray, force: np.ndarray, omega: float) -> float:
    """Friction work of a period [J], of `energy` on the structure and of forces (n_pair, ..., n_time) on belts."""
    belts = np.array([e.numbers["belt"] for e in problem.elements])
    return float(energy.sum() - belts @ force[:, 0].mean(axis=-1) * HZ / omega)


def _mean(coefficients: np.ndarray) -> np.ndarray:
    return coefficients[..., 0] * (coefficients.shape[-1] % 2)


def _shares(balance: td.matrices.Balance, force: np.ndarray) -> np.ndarray:
    """Shares of open, stick and slip of forces (n_pair, n_component, n_time), nan where no element has them."""
    shares, components = [], balance.problem.contact.components
    for joint in balance.problem.contact.joints:
        numbers, tangential = joint.parameters.numbers, joint.parameters.tangential
        of_joint = force[joint.rows]
        push = (
            of_joint[:, components.index("n")] if "n" in components else numbers.get("normal_load", np.ones(1))[:, None]
        )
        pull = np.sqrt((of_joint[:, tangential] ** 2).sum(axis=1))
        limit = numbers.get("friction", np.ones(1))[:, None] * push
        if "cubic" not in numbers:
            slips = (push > 0) & (pull >= limit * (1 - 1e-6))
            lifts = np.broadcast_to(push <= 0, slips.shape)
            shares += np.stack([lifts, ~lifts & ~slips, slips], axis=-1).mean(axis=1).tolist()
    return np.mean(shares, axis=0) if shares else np.full(3, np.nan)


def in_time(problem: Problem, balance: td.matrices.Balance, motions: Motions, steps: int = STEPS) -> Record:
    """The column of integration in time, from the motions of the balance that are not unstable."""
    rows, notes, clock = list[Row](), list[str](), process_time()
    for cycle, is_stable in motions:
        if is_stable == 0.0:
            continue
        try:
            m = balance.integrate(cycle.frequency, cycle, steps=steps, max_periods=400, rigid=problem.is_rigid)
        except (Refusal, SolverFailure) as failure:
            notes.append(str(failure))
            continue
        phase = float(np.angle(np.mean(m.outputs[0] * np.exp(-1j * m.omega * m.time))))
        energy, shares = _work(problem, m.energy, m.force, m.omega), _shares(balance, m.force)
        row = Row(POINT, m.omega, float(m.amplitude[0]), float(m.outputs[0].mean()), phase, energy, *shares, 1.0)
        notes += [] if m.periodic else [f"{m.omega:g} rad/s: {m.outcome}"]
        rows += [] if row.is_in(rows) or not m.periodic else [row]
    settings = f"{steps} steps a period" + ("; without springs" if problem.is_rigid else "")
    return Record(_head(problem, settings, process_time() - clock, "; ".join(notes)), tuple(rows))


def truth_by_steps(problem: Problem, balance: td.matrices.Balance, motions: Motions) -> Record:
    """The truth of a problem that is not piecewise linear: the finer of two step sizes, and their difference."""
    coarse, fine = (in_time(problem, balance, motions, steps) for steps in (STEPS, 2 * STEPS))
    rows = []
    for row in fine.rows:
        near = [abs(r.amplitude / row.amplitude - 1) for r in coarse.rows if r.frequency == row.frequency]
        rows.append(replace(row, error=min(near, default=np.inf)))
    return Record(fine.head, tuple(rows))


def _head(problem: Problem, settings: str, seconds: float, note: str) -> dict[str, str]:
    return {
        "problem": problem.name, "program": f"tribodyn {td.__version__}", "settings": settings,
        "seconds": f"{seconds:.3g}", "source": f"./tribodyn prove bench {problem.name} --run", "note": note,
    }  # fmt: skip

"""The bench as text: one table, and a page for each problem; and how the columns of tribodyn come to be."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from proof.bench import events, problem as problems, record
from proof.bench.record import CURVE, TRUTH, Record

COLUMNS = {
    "tribodyn": "tribodyn", "tribodyn_time": "tribodyn, in time", "nlvib": "NLvib", "tmdsimpy": "tmdsimpy",
    "pyharm": "pyHarm", "nlstep": "NLstep",
}  # fmt: skip


def compute(names: Sequence[str], with_truth: bool, say: Callable[[str], None]) -> None:
    """Compute tribodyn's columns of some problems, and their truth; write their files."""
    from proof.bench import tribodyn_columns as columns

    for name in names:
        say(name)
        problem = problems.read(name)
        if with_truth and problem.truth == "events":
            settings, source = f"{events.STEPS} steps a period", f"./tribodyn prove bench {name} --truth"
            head = {"problem": name, "program": "integration from event to event", "settings": settings}
            Record({**head, "source": source}, tuple(events.sweep(problem))).write(TRUTH)
        balance = columns.balance_of(problem)
        column, motions = columns.in_frequency(problem, balance)
        column.write("tribodyn")
        if problem.truth == "events" or problem.is_rigid:
            columns.in_time(problem, balance, motions).write("tribodyn_time")
        if with_truth and problem.truth != "events":
            columns.truth_by_steps(problem, balance, motions).write(TRUTH)


def table(names: Sequence[str]) -> str:
    """A line for each problem; for each program its largest error of amplitude, and the seconds of its curve."""
    lines = [["problem", "coordinates, elements, orders", *COLUMNS.values()]]
    for name in names:
        problem, columns = problems.read(name), record.columns(name)
        size = f"{len(problem.mass)}, {len(problem.elements)}, {len(problem.orders)}"
        lines.append([name, size, *(_cell(columns.get(column), columns.get(TRUTH)) for column in COLUMNS)])
    return _text(lines)


def _cell(column: Record | None, truth: Record | None) -> str:
    if column is None or truth is None:
        return ""
    score = record.score(column, truth)
    seconds = f", {float(column.head['seconds']):.2g} s" if "seconds" in column.head else ""
    missing = f", {score.missing} of {len(truth.points)} missing" if score.missing else ""
    return f"{100 * score.amplitude:.2g} %{seconds}{missing}"


def page(name: str) -> str:
    """What a problem is, what each program gives for it, and its motions."""
    problem, columns = problems.read(name), record.columns(name)
    truth, programs = columns[TRUTH], [columns[key] for key in COLUMNS if key in columns]
    lines = [["program", "settings", "highest of the curve", "error of amplitude", "of energy", "s", "source"]]
    for column in programs:
        score = record.score(column, truth)
        top = max((row for row in column.rows if row.kind == CURVE), key=lambda row: row.amplitude, default=None)
        highest = "" if top is None else f"{top.amplitude:.5g} m at {top.frequency:.5g} rad/s"
        facts = [column.head.get(key, "") for key in ("program", "settings", "seconds", "source")]
        lines.append([*facts[:2], highest, f"{score.amplitude:.1e}", f"{score.energy:.1e}", *facts[2:]])
    motions = [["rad/s", "amplitude [m]", "mean [m]", "phase [rad]", "energy [J]", "open, stick, slip", "error"]]
    for r in truth.points:
        numbers = [f"{x:.6g}" for x in (r.frequency, r.amplitude, r.mean, r.phase, r.energy)]
        motions.append([*numbers, f"{r.open:.3f}, {r.stick:.3f}, {r.slip:.3f}", f"{r.error:.0e}"])
    notes = [f"{c.head['program']}: {c.head['note']}." for c in programs if c.head.get("note")]
    about = f"`{name}`. {problem.about} Source: {problem.source}."
    word = f"Truth: {truth.head['program']}, {truth.head['settings']}; its own error stands last."
    return "\n\n".join([f"## {problem.title}", about, _text(lines), *notes, word, _text(motions)]) + "\n"


def _text(lines: list[list[str]]) -> str:
    """A table in Markdown."""
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines).replace("nan", "-")

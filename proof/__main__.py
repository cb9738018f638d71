"""The proofs of the program, from the root of a checkout: ./tribodyn prove WORD ..."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import cyclopts
from cyclopts import Parameter

from proof.cases.blade.commands import blade
from proof.cases.leaf_seal.commands import leaf
from proof.cases.rig.commands import rig
from proof.words import PICTURE, report_progress
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.command.main import guard
from tribodyn.workflows.command.word import Flag, Json, Overrides, make_room


def bench(
    *,
    quick: Flag = False,
    fe: Annotated[tuple[str, ...], Parameter(name="--fe", negative=(), consume_multiple=False)] = (),
    way: Annotated[tuple[str, ...], Parameter(name="--way", negative=(), consume_multiple=False)] = (),
    contact: Annotated[tuple[str, ...], Parameter(name="--contact", negative=(), consume_multiple=False)] = (),
    peer: Path | None = None,
    as_json: Json = False,
) -> None:
    """Measure the solver beside the dense algorithm of the thesis on the beam scene (tables 7.1 to 7.3).

    Parameters
    ----------
    quick
        Harmonics 0+1 and 0+3 alone, in under a minute.
    fe
        Time and memory of a reduction at "30k", "100k", "300k" or "1M" DOFs instead, beside plain statements of the
        same library, of cubes ("36k-cubes", "140k-cubes", "1M-cubes"), or of an
        "assembly" of 200 000 DOFs with three joints; can be repeated.
    way
        One way of --fe alone: "product", "by hand", "flexibility" (no contact DOFs in the model); can be repeated.
    contact
        Set-up, memory and seconds of one response at 0+3 on "500", "1500", "3k", "12k" or "48k" contact DOFs instead,
        with residual flexibility and, up to 3k, beside the dense compliance; can be repeated.
    peer
        A Python interpreter with pyHarm (pip install pyHarm-os): small problems in both programs instead.
    as_json
        Print JSON for machines.
    """
    if peer is not None:
        from proof import peers

        races = peers.run(peer, report_progress)
        print(json.dumps(peers.as_records(races), indent=2) if as_json else peers.as_text(races))
        return
    if fe:
        from proof import large_fe

        costs = large_fe.run(fe, report_progress, way)
        print(json.dumps(large_fe.as_records(costs), indent=2) if as_json else large_fe.as_text(costs))
        return
    if contact:
        from proof import large_contact

        sizes = large_contact.run(contact, report_progress)
        print(json.dumps(large_contact.as_records(sizes), indent=2) if as_json else large_contact.as_text(sizes))
        return
    from proof import bench as shown

    rows = shown.run(quick, report_progress)
    print(json.dumps(shown.as_records(rows), indent=2) if as_json else shown.as_text(rows))


def scoreboard(
    *,
    scenes: int = 40,
    seed: int = 1,
    seconds: float = 60.0,
    wear: Flag = False,
    out: Path = Path("scoreboard"),
    as_json: Json = False,
) -> None:
    """Compare stated errors and error bounds of random scenes with references that are finer in every setting.

    Exit code 3 where a true error is above the stated one. Rows are kept: the same command goes on where it was ended.

    Parameters
    ----------
    scenes
        How many are drawn. 0: none, all rows of the seed that are kept are counted again.
    seed
        Of the draw.
    seconds
        Processor seconds that the run of a scene may take, and its reference again.
    wear
        Scenes that all wear, along their motion in time.
    out
        Folder of the rows, the table and the histogram.
    as_json
        Print JSON for machines.
    """
    from proof import scoreboard as board, scoreboard_table as table

    make_room(out)
    rows = board.run(scenes, seed, out, seconds, report_progress, wear)
    table.write(rows, out)
    print(json.dumps([asdict(row) for row in rows], indent=2) if as_json else table.summary(rows))
    broken = sum(statement.violated for row in rows for statement in (*row.judged, *row.bound))
    if broken:
        raise SolverFailure(f"{broken} stated errors are violated, see {out / 'scoreboard.csv'}")


def faults(*, tree: Path = Path(), seconds: float = 20.0, out: Path = Path("faults"), as_json: Json = False) -> None:
    """Plant faults in the sources, one at a time: what each changes in results, and which test or setting sees it.

    Parameters
    ----------
    tree
        Root of a clone of the repository.
    seconds
        Processor seconds for the tests of one fault, and again for the judge of extremes.
    out
        Folder of the rows and the table. Rows are kept: the same command goes on where it was ended.
    as_json
        Print JSON for machines.
    """
    from proof import planted_faults

    make_room(out)
    rows = planted_faults.run(tree.resolve(), out.resolve(), report_progress, seconds)
    text = planted_faults.as_markdown(rows)
    (out / "faults.md").write_text(text, encoding="utf-8")
    print(json.dumps([asdict(row) for row in rows], indent=2) if as_json else text)


def fuzz(
    scene: str | None = None,
    *,
    count: int = 1000,
    prefix: str = "",
    values: int | None = None,
    runs: int | None = None,
    seed: int = 0,
    seconds: float = 10.0,
    workers: int = 1,
    out: Path | None = None,
    overrides: Overrides = (),
    as_json: Json = False,
) -> None:
    """Give every key of a scene thirty fuzz inputs, one at a time, and report how the runs end; or damage all input.

    With a scene, all are read; the scenes that come out of those which reading accepts are run. Without, several keys
    and tables at once of small scenes, files of studies, optima and fits, decks and matrices, each run. Each ends well,
    is refused, or fails with a sentence; exit code 3 where one does not.

    Parameters
    ----------
    scene
        Name of a scene or a .toml file; make it small with --set, so that a run takes a second.
    count
        Cases without a scene, drawn at random.
    only
        Beginning of the names of what is damaged, such as run or "study fit".
    values
        How many pairs of key and value, drawn at random; all of them by default.
    runs
        How many of the scenes that are accepted are run, drawn at random; all of them by default.
    seed
        Of the draws.
    seconds
        Processor seconds that a run may take; without a scene, without a word of progress.
    workers
        Runs at a time.
    out
        Folder that keeps the runs: the same command goes on where it was ended, and runs again what ended wrong.
    as_json
        Print JSON for machines.
    """
    from proof import fuzz as measured, fuzz_mixed
    from tribodyn.workflows.command import main as command

    make_room(out)
    if scene is None:
        cases = fuzz_mixed.tries(count, seed, seconds, report_progress, workers, prefix, command=command.main)
    else:
        cases = measured.fuzz(
            scene, overrides, values, runs, seed, seconds, workers, report_progress, out, command=command.main
        )
    wrong = [case for case in cases if not case.good and not case.same_as]
    if as_json:
        counts = {} if scene is None else {"counts": measured.counts(cases)}
        print(json.dumps({**counts, "wrong": [case.record() for case in wrong]}, indent=2))
    else:
        print(fuzz_mixed.as_table(cases) if scene is None else measured.as_text(cases))
    if wrong:
        raise SolverFailure(f"{len(wrong)} of {sum(not case.same_as for case in cases)} values did not end as they may")


def branches(*, problems: int = 20, first: int = 0, as_json: Json = False) -> None:
    """Follow response curves of random friction problems, with lift-off and impacts, from both ends.

    Each is followed to its end with the same folds both ways, its points checked by a march of the friction law, or
    refused with a sentence; exit code 3 where one is wrong.

    Parameters
    ----------
    problems
        How many.
    first
        Number of the first one; problem 7 is the same one always.
    as_json
        Print JSON for machines.
    """
    from proof import branches as curves

    rows = curves.run(range(first, first + problems), report_progress)
    print(json.dumps(curves.as_records(rows), indent=2) if as_json else curves.as_text(rows))
    wrong = sum(row.outcome == curves.WRONG for row in rows)
    if wrong:
        raise SolverFailure(f"{wrong} of {len(rows)} curves are wrong, see the table")


def extremes(*, quick: Flag = False, out: Path = Path("extremes.png"), as_json: Json = False) -> None:
    """Try the solver at its numerical extremes: each cell converged and checked, or refused with a sentence.

    Parameters
    ----------
    quick
        Every eighth cell, on smaller models and up to 1e9 N/m.
    out
        File of the picture.
    as_json
        Print JSON for machines.
    """
    from proof import extremes as table, extremes_picture

    make_room(out, PICTURE)
    rows = table.run(quick, report_progress)
    extremes_picture.picture(rows).savefig(out)
    print(json.dumps(table.as_records(rows), indent=2) if as_json else table.as_text(rows))
    wrong = table.counts(rows)["wrong"]
    if wrong:
        raise SolverFailure(f"{wrong} of {len(rows)} extreme settings ended with a wrong number, see the table")


def ablations(
    *rules: str, problems: int = 8, scenes: tuple[str, ...] = ("beam", "blade", "rig"), as_json: Json = False
) -> None:
    """Switch off the tuned rules of the solver, one at a time, and count the outcomes that change.

    Parameters
    ----------
    rules
        Names of rules, such as fold_reach; all by default.
    problems
        Problems of `branches` that are solved without each.
    scenes
        Coarse scenes that are run without each: beam, "beam with harmonics 0 to 5", blade, rig.
    as_json
        Print JSON for machines.
    """
    from proof import ablations as proof

    rows = proof.run(rules, problems, scenes, report_progress)
    print(json.dumps([asdict(row) for row in rows], indent=2) if as_json else proof.as_text(rows))


def mistuned(*, count: int = 100, dense: int = 3, as_json: Json = False) -> None:
    """Solve mistuned wheels at 0.05, 0.1 and 0.5 % damping with open, slipping and stuck contacts.

    Exit code 3 where a pattern is not solved, its contacts do not do what they should, or its blades differ from those
    of the wheel assembled without symmetry by more than 1e-4.

    Parameters
    ----------
    count
        Patterns of each of the nine settings.
    dense
        The first ones of each that are solved on the wheel without symmetry too.
    as_json
        Print JSON for machines.
    """
    from proof import mistuned as proof

    if not 1 <= dense <= count:
        raise Refusal(f"--count {count} --dense {dense}: give at least 1 pattern, and at most as many dense")
    groups = proof.run(count, dense, report_progress)
    print(json.dumps(proof.as_records(groups), indent=2) if as_json else "\n".join(group.line() for group in groups))
    wrong = sum(group.wrong(dense) for group in groups)
    if wrong:
        raise SolverFailure(f"{wrong} of {len(groups)} settings of mistuned wheels are wrong, see the table")


def wear_steps(scene: str, *, overrides: Overrides = (), out: Path | None = None, as_json: Json = False) -> None:
    """Cost and error of wear steps by both rules: table 4.2 of the thesis with the life added.

    Parameters
    ----------
    scene
        Name of a scene or a .toml file.
    out
        File of the picture.
    as_json
        Print JSON for machines.
    """
    from proof import wear_steps as shown

    if out is not None:
        make_room(out, PICTURE)
    table = shown.compare(scene, report_progress, overrides)
    if out is not None:
        shown.picture(table).savefig(out)
    print(json.dumps(shown.as_records(table), indent=2) if as_json else shown.as_text(table))


def wear(*, scenes: int = 12, seconds: float = 60.0, as_json: Json = False) -> None:
    """Compare lives of random scenes that slip and lift with brute force, every block of cycles integrated in time.

    Exit code 3 where a true error is above the stated one.

    Parameters
    ----------
    scenes
        How many are drawn.
    seconds
        Processor seconds that the run of a scene may take, with its errors.
    as_json
        Print JSON for machines.
    """
    from proof import brute_wear

    rows = brute_wear.run(scenes, report_progress, seconds=seconds)
    records = [{**asdict(row), "outcome": row.outcome} for row in rows]
    print(json.dumps(records, indent=2) if as_json else brute_wear.as_text(rows))
    if broken := sum(row.outcome == "violated" for row in rows):
        raise SolverFailure(f"{broken} stated lives are violated, see the table")


app = cyclopts.App(name="prove", help="Proofs of tribodyn: speed, extremes, faults, errors of unseen scenes.")
for word in (
    bench,
    extremes,
    faults,
    scoreboard,
    branches,
    ablations,
    fuzz,
    mistuned,
    wear,
    wear_steps,
    blade,
    leaf,
    rig,
):
    app.command(word)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a proof and leave with its exit code."""
    guard(lambda: app(arguments, exit_on_error=False, print_error=False))


if __name__ == "__main__":
    os.environ.setdefault("TRIBODYN_CACHE", "off")  # a proof makes what it proves, and scenes at random fill no disk
    main()

"""The proofs of the program, from the root of a checkout: ./tribodyn prove WORD ..."""

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import cyclopts

from proof.cases.blade.commands import blade
from proof.cases.leaf_seal.commands import leaf
from proof.cases.rig.commands import rig
from proof.words import PICTURE, report_progress
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.command.main import guard
from tribodyn.workflows.command.word import Flag, Json, Overrides, make_room


def large(*sizes: str, as_json: Json = False) -> None:
    """Measure time and memory of the reduction of large meshes.

    Parameters
    ----------
    sizes
        Of the beam: "30k", "100k", "300k", "1M" DOFs, or of cubes, "36k-cubes", "140k-cubes", "1M-cubes".
    as_json
        Print JSON for machines."""
    from proof import large_fe

    costs = large_fe.run(sizes, report_progress)
    print(json.dumps([asdict(row) for row in costs], indent=2) if as_json else large_fe.as_text(costs))


def speed(*highest: int, dense_points: int = 2) -> None:
    """Follow the response of the thesis's beam beside the dense algorithm: seconds, their ratio, differences.

    Parameters
    ----------
    highest
        Highest harmonics; 1, 3 and 5 by default.
    dense_points
        Points that the dense algorithm solves in each of three parts of the range."""
    from proof import speed as comparison

    comparison.run(highest or (1, 3, 5), dense_points, print)


def bench(*problems: str, run: Flag = False, truth: Flag = False, page: Flag = False) -> None:
    """Compare programs on problems of vibration with friction and contact: errors beside the truth, and seconds.

    The files and their format are described in proof/bench/README.md.

    Parameters
    ----------
    problems
        Names of problems; all of them by default.
    run
        Compute the columns of tribodyn first and write their files.
    truth
        Compute the truth, too.
    page
        Print the pages of the problems, with settings, sources and motions."""
    from proof.bench import pages, problem

    names = problems or tuple(problem.names())
    if unknown := set(names) - set(problem.names()):
        raise Refusal(f"there is no problem '{min(unknown)}': there are {', '.join(problem.names())}")
    if run or truth:
        pages.compute(names, truth, report_progress)
    print("\n".join(map(pages.page, names)) if page else pages.table(names))


def scoreboard(
    *,
    scenes: int = 40,
    seed: int = 1,
    seconds: float = 60.0,
    kind: Literal["parts", "wear", "masses"] = "parts",
    modes: Flag = False,
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
    kind
        Meshed parts, parts that all wear along their motion in time, or matrices of 1 to 20 masses.
    modes
        Their stress with 20, 40 and 80 modes beside nearly all of them instead, and whether its stated errors hold.
    out
        Folder of the rows, the table and the histogram.
    as_json
        Print JSON for machines."""
    from proof.unseen_scenes import scoreboard as board, scoreboard_table as table, stress_modes

    if modes:
        ladders = stress_modes.run(scenes, seed, report_progress)
        arrays = [(name, changes.tolist(), stated.tolist()) for name, changes, stated in ladders]
        print(json.dumps(arrays, indent=2) if as_json else stress_modes.as_text(ladders))
        return
    make_room(out)
    rows = board.run(scenes, seed, out, seconds, report_progress, kind)
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
        Print JSON for machines."""
    from proof import planted_faults

    make_room(out)
    rows = planted_faults.run(tree.resolve(), out.resolve(), report_progress, seconds)
    text = planted_faults.as_markdown(rows)
    (out / "faults.md").write_text(text, encoding="utf-8")
    print(json.dumps([asdict(row) for row in rows], indent=2) if as_json else text)


def fuzz(
    *, count: int = 1000, prefix: str = "", seed: int = 0, seconds: float = 10.0, workers: int = 1,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Damage all input, and report how the runs end.

    Several keys and tables at once of small scenes, files of studies, optima and fits, decks and matrices, each run.
    Each ends well, is refused, or fails with a sentence; exit code 3 where one does not.

    Parameters
    ----------
    count
        Cases, drawn at random.
    prefix
        Beginning of the names of what is damaged, such as run or "study fit".
    seed
        Of the draws.
    seconds
        Processor seconds that a run may take without a word of progress.
    workers
        Runs at a time.
    as_json
        Print JSON for machines."""
    from proof.fuzzing import fuzz as proof
    from tribodyn.workflows.command import main as command

    cases = proof.tries(count, seed, seconds, report_progress, workers, prefix, command=command.main)
    wrong = [case for case in cases if not case.good]
    print(json.dumps([asdict(case) for case in wrong], indent=2) if as_json else proof.as_table(cases))
    if wrong:
        raise SolverFailure(f"{len(wrong)} of {len(cases)} cases did not end as they may")


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
        Print JSON for machines."""
    from proof import branches as curves

    rows = curves.run(range(first, first + problems), report_progress)
    print(json.dumps([asdict(row) for row in rows], indent=2) if as_json else curves.as_text(rows))
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
        Print JSON for machines."""
    from proof.hard_settings import extremes as table, extremes_picture

    make_room(out, PICTURE)
    rows = table.run(quick, report_progress)
    extremes_picture.picture(rows).savefig(out)
    print(json.dumps(table.as_records(rows), indent=2) if as_json else table.as_text(rows))
    wrong = table.counts(rows)["wrong"]
    if wrong:
        raise SolverFailure(f"{wrong} of {len(rows)} extreme settings ended with a wrong number, see the table")


def wear_steps(scene: str, *, overrides: Overrides = (), out: Path | None = None, as_json: Json = False) -> None:
    """Cost and error of wear steps by both rules: table 4.2 of the thesis with the life added.

    Parameters
    ----------
    scene
        Name of a scene or a .toml file.
    out
        File of the picture.
    as_json
        Print JSON for machines."""
    from proof import wear_steps as shown

    if out is not None:
        make_room(out, PICTURE)
    table = shown.compare(scene, report_progress, overrides)
    if out is not None:
        shown.picture(table).savefig(out)
    print(json.dumps([asdict(row) for row in table.rows], indent=2) if as_json else shown.as_text(table))


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
        Print JSON for machines."""
    from proof import brute_wear

    rows = brute_wear.run(scenes, report_progress, seconds=seconds)
    records = [{**asdict(row), "outcome": row.outcome} for row in rows]
    print(json.dumps(records, indent=2) if as_json else brute_wear.as_text(rows))
    if broken := sum(row.outcome == "violated" for row in rows):
        raise SolverFailure(f"{broken} stated lives are violated, see the table")


app = cyclopts.App(name="prove", help="Proofs of tribodyn: speed, extremes, faults, errors of unseen scenes.")
for word in (bench, speed, large, extremes, faults, scoreboard, branches, fuzz, wear, wear_steps, blade, leaf, rig):
    app.command(word)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a proof and leave with its exit code."""
    guard(lambda: app(arguments, exit_on_error=False, print_error=False))


if __name__ == "__main__":
    os.environ.setdefault("TRIBODYN_CACHE", "off")  # a proof makes what it proves, and scenes at random fill no disk
    main()

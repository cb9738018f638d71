"""Damage of several kinds at once: keys two and three together, tables, files of studies and fits, decks, matrices.

Each case is a command with the files that it reads: small scenes are run, other shipped scenes planned, studies,
searches for an optimum, lives and fits done, decks inspected and run in a scene, matrices run. It ends well, fails or
is refused with one sentence, or is wrong: another exception, a warning of a library, a number that is not finite, more
than ten seconds of the processor without a word of progress."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomli_w
from pyuff import UFF
from pyyeti.nastran import op4
from scipy.io import savemat

from proof.fuzzing.fuzz_damage import bytes_damaged, lines_damaged, tables_damaged
from proof.fuzzing.fuzz_runs import GOING, RUN, Command, FuzzEnd, Job, Runs
from tests.helpers import foreign_files
from tests.helpers.coarse_scenes import BEAM
from tests.helpers.lap_deck import OWN, REST, TEXT
from tests.helpers.matrix_scene import SCENE, matrix_folder
from tests.helpers.structures import BLOCKS
from tribodyn.workflows.export.result_tables import DataKind, Function, function
from tribodyn.workflows.result.number_format import write_columns
from tribodyn.workflows.scene import scene_file

INPUTS = (
    "-1", "0", "1", "1e-300", "1e300", "-1e300", "nan", "inf", "-inf", "3.5", "1000000", "true", '""', '"abc"', "[]",
    "[1]", "[[1]]", "{}", '"1 parsec"', '"-1 mm"', '"1e300 kN"', '"1e-300 s"', '"0 Hz"', '"nan Hz"', '"inf N"',
    '"250 %"', '"1e12 N/um"', '"../x"', "[1, 2, 3, 4, 5, 6, 7]", '["a", "b"]',
)  # fmt: skip
"""TOML values, thirty of them."""

QUIET = ("verdict.enabled=false", "harmonics.kept=[0, 1]", "harmonics.samples=32", "wear.max_steps=1")
SMALL = {
    "beam": (*BEAM, "verdict.enabled=false", "wear.max_steps=1"),
    "leaf_seal": ("geometry.n_column=9", "geometry.pin_column=2", "geometry.n_web=1", "reduction.modes=4",
        "verdict.enabled=false", "harmonics.kept=[0, 1]", "response.frequency=['30 Hz', '45 Hz']"),
    "blade": ("geometry.n_along=2", "geometry.n_up=2", "reduction.cutoff=3 kHz", "response.points=6", *QUIET),
}  # fmt: skip
"""Changes with which a run of a shipped scene takes a second or two of the processor."""

VARY = {"contact.friction": [0.3, 0.5], "loads.static.press.value": ["10 kN", "20 kN"]}
DRAWN = {
    "contact.friction": {"distribution": "uniform", "low": 0.3, "high": 0.6},
    "damping.modal": {"distribution": "loguniform", "low": "0.5 %", "high": "2 %"},
}
UNWORN = ["geometry.n_patch=3", "geometry.n_length=2", "geometry.n_height=1", "reduction.modes=3", "wear=",
          "harmonics.kept=[0, 1]", "harmonics.samples=32", "response.points=6"]  # fmt: skip
FIT = {
    "parameters": {"kt": {"keys": ["contact.tangential_stiffness"], "low": "200 N/um", "high": "900 N/um"}},
    "measured": {"mode": {"of": "stuck frequency", "mode": 1, "value": "420 Hz"}},
}
ROWS = """
[scene]
title = "Two DOFs and the ground"
[model]
{}
[contact]
dofs = [[0, 1, 2]]
area = "10 mm2"
tangential_stiffness = "1 N/m"
normal_stiffness = "1 N/m"
friction = 0.4
[loads.static.press]
dofs = [2]
value = "1 N"
[loads.harmonic.shaker]
dofs = [0]
value = "0.1 N"
[response]
dofs = [0]
frequency = ["0.1 Hz", "0.4 Hz"]
points = 5
"""


@dataclass(frozen=True)
class Base:
    """What cases are made of: a command, its files, and which of them is damaged.

    tables : whether whole tables of it are damaged too; keys : of a scene, changed by --set"""

    kind: str
    words: tuple[str, ...]
    files: dict[str, bytes]
    damaged: str
    tables: bool = False
    keys: tuple[str, ...] = ()
    values: dict[str, Any] = field(default_factory=dict)

    def job(self, changes: str = "", content: str | bytes | None = None, overrides: Sequence[str] = ()) -> Job:
        """The command with changed contents of the file and more changes of keys."""
        damaged = content.encode("latin-1", "replace") if isinstance(content, str) else content
        files = self.files if damaged is None else {**self.files, self.damaged: damaged}
        return Job(self.kind, changes, (*self.words, *_set(overrides)), files)


def _set(changes: Iterable[str]) -> tuple[str, ...]:
    return tuple(word for text in changes for word in ("--set", text))


def bases(folder: Path) -> list[Base]:
    """All inputs as they are; folder : keeps files for them."""
    return [*_scenes(), *_structures(folder), *_studies(), *_decks(folder), *_matrices(folder)]


def _scene(kind: str, text: str, words: Callable[[str], tuple[str, ...]], changes: Sequence[str], place: Path) -> Base:
    """A scene in a file of its own, beside the files of a place."""
    dump = scene_file.parse(text, "own.toml", changes, place).scene.model_dump()
    neighbours = {path.name: path.read_bytes() for path in place.iterdir() if path.is_file()}
    files = {**neighbours, "own.toml": text.encode()}
    keys = tuple(sorted(set(_names_of(dump))))
    return Base(kind, (*words("own.toml"), *_set(changes)), files, "own.toml", True, keys, dump)


def _names_of(table: dict[str, Any], above: str = "") -> Iterator[str]:
    """Every section and key of the tables of a scene."""
    for name, value in table.items():
        is_part = name == "parameters"  # of a part: keys of the table around them
        if not is_part:
            yield f"{above}{name}"
        if isinstance(value, dict):
            yield from _names_of(value, above if is_part else f"{above}{name}.")


def _run(name: str) -> tuple[str, ...]:
    return "run", name, *RUN


def _scenes() -> list[Base]:
    """Shipped scenes: small ones run, all planned."""
    inputs = []
    for name in scene_file.names():
        place = scene_file.find(name)
        text = place.read_text(encoding="utf-8")
        inputs.append(_scene(f"plan {name}", text, lambda file: ("plan", file), (), place.parent))
        if name in SMALL:
            inputs.append(_scene(f"run {name}", text, _run, SMALL[name], place.parent))
    return inputs


def _structures(folder: Path) -> list[Base]:
    """Several bodies, a deck in a scene, and matrices in a scene."""
    (empty := folder / "empty").mkdir()
    (decks := folder / "decks").mkdir()
    (rows := folder / "rows").mkdir()
    (decks / "lap.inp").write_text(TEXT, encoding="utf-8")
    matrix_folder(rows)
    (rows / "own.toml").unlink()
    small = (*QUIET[:3], "response.points=5")
    scene = _scene("run deck", OWN + REST, _run, small, decks)
    return [
        _scene("run bodies", BLOCKS, _run, small, empty),
        scene,
        replace(scene, kind="run deck damaged", damaged="lap.inp", tables=False),
        _scene("run matrices", SCENE, _run, (*QUIET, "response.points=6"), rows),
    ]  # fmt: skip


def _studies() -> list[Base]:
    """A study, lives, a search for an optimum and a fit of a small beam."""
    shared = {"scene": "beam", "set": UNWORN}
    peak = {"number": "amplitude_first"}
    drawn = {"study": {**shared, "design": "sobol", "runs": 2, "seed": 1}, "vary": DRAWN}
    best = {"aims": [{**peak, "want": "low"}], "evaluations": 3}
    tables = {
        "grid": {"study": {**shared, "design": "grid"}, "vary": VARY},
        "lives": {**drawn, "study": {**drawn["study"], "runs": 9}, "lives": peak},
        "optimise": {**drawn, "optimise": best},
        "fit": FIT,
    }
    inputs = []
    for word, table in tables.items():
        text: bytes = tomli_w.dumps(table).encode()
        words = ("study", word, "own.toml", "--workers", "1", "--out", "out")
        if word == "fit":
            words = ("study", "identify", "beam", "own.toml", *_set([*UNWORN, "verdict.enabled=false"]))
        inputs.append(Base(f"study {word}", words, {"own.toml": text}, "own.toml", True))
    return inputs


def _decks(folder: Path) -> list[Base]:
    """Decks of three programs and meshes with modes."""
    mesh, inputs = foreign_files.bricks(folder), []
    files = {
        ending: foreign_files.write(mesh, folder / f"deck{ending}", "4.1").read_bytes()
        for ending in (".inp", ".bdf", ".cdb", ".msh", ".vtu", ".med")
    }
    files[".cdb"] += b"MP,DENS,1,7860.\nMP,NUXY,1,.3\n"
    files["_lap.inp"] = TEXT.encode()
    for ending, content in files.items():
        words = ["inspect", f"own{ending}", "--unit", "mm", "--modes", "2"]
        if "lap" not in ending:
            words += ["--young", "210GPa", "--density", "7860 kg/m3"]
        inputs.append(Base(f"inspect {ending}", tuple(words), {f"own{ending}": content}, f"own{ending}"))
    return inputs


def _matrices(folder: Path) -> list[Base]:
    """Matrices of three formats in a scene, the file of the matrices damaged."""
    K, M = np.diag([2.0, 3.0, 4.0]) - np.eye(3, k=1) - np.eye(3, k=-1), np.eye(3)
    op4.write(str(folder / "two.op4"), {"k": K, "m": M}, binary=False)
    entries = [f"DMIG,{name},{j + 1},1,,{i + 1},1,{m[i, j]}" for name, m in (("K", K), ("M", M))
               for j in range(3) for i in range(j, 3)]  # fmt: skip
    rows = {name: "".join(f"{i + 1},1,{j + 1},1,{m[i, j]}\n" for i in range(3) for j in range(i + 1))
            for name, m in (("K", K), ("M", M))}  # fmt: skip
    texts = {
        "two.op4": (folder / "two.op4").read_text(),
        "two.pch": "\n".join(["DMIG,K,0,6,2,0,,,3", "DMIG,M,0,6,2,0,,,3", *entries, ""]),
        "K.mtx": rows["K"],
    }
    inputs = []
    for name, text in texts.items():
        model = 'mass = "M.mtx"\nstiffness = "K.mtx"' if name == "K.mtx" else f'file = "{name}"'
        files: dict[str, bytes] = {name: text.encode(), "own.toml": ROWS.format(model).encode()}
        if name == "K.mtx":
            files["M.mtx"] = rows["M"].encode()
        words = (*_run("own.toml"), *_set(QUIET[:3]))
        inputs.append(Base(f"run {name}", words, files, name))
    return [*inputs, *_measurements(folder, files)]


def _measurements(folder: Path, scene: dict[str, bytes]) -> list[Base]:
    """Measurements of three formats beside a scene of matrices."""
    hertz = np.linspace(0.0, 0.4, 9)
    columns = {"frequency_Hz": hertz, "displacement_m": hertz, "force_N": hertz + 1, "phase_deg": -hertz}
    write_columns(columns, folder / "m.csv")
    savemat(folder / "m.mat", columns)
    units = DataKind.FREQUENCY, "Hz", hertz, DataKind.DISPLACEMENT, "m", (1 + 1j) * hertz
    UFF(str(folder / "m.uff")).write_sets(function(Function.FRF, "tap", "frequency", *units), "add")
    files = {name: {**scene, name: (folder / name).read_bytes()} for name in ("m.csv", "m.mat", "m.uff")}
    words = "study", "compare", "own.toml"
    return [Base(f"compare {name}", (*words, name, "--out", "out"), of, name) for name, of in files.items()]


def case(base: Base, rng: np.random.Generator) -> Job:
    """An input with two or three keys changed, or with damage to its text and some keys."""
    content: str | bytes | None = None
    damages = None
    if not base.keys and (b"\0" in base.files[base.damaged] or rng.random() < 0.5):
        content, damages = bytes_damaged(base.files[base.damaged], rng)
    elif not base.keys or rng.random() < 0.4:
        damage = tables_damaged if base.tables and rng.random() < 0.4 else lines_damaged
        content, damages = damage(base.files[base.damaged].decode(), rng)
    changes: list[str] = []
    if base.keys:
        numbers = [key for key in base.keys if isinstance(_value_at(base.values, key), bool | int | float)]
        candidates = numbers if rng.random() < 0.8 else base.keys
        keys = rng.choice(candidates, int(rng.integers(0 if damages else 2, 4)), replace=False)
        changes = [f"{key}={_value(_value_at(base.values, str(key)), rng)}" for key in keys]
    return base.job(" ".join([*([damages] if damages else []), *changes]), content, changes)


def _value_at(dump: Any, key: str) -> Any:
    """What a scene has at a key, None where it has nothing."""
    for word in key.split("."):
        dump = dump.get(word, (dump.get("parameters") or {}).get(word)) if isinstance(dump, dict) else None
    return dump


def _value(value: Any, rng: np.random.Generator) -> str:
    """A fuzz input for a key, or, more often, its own number somewhat changed or its switch the other way."""
    if rng.random() < 0.1 or not isinstance(value, bool | int | float):
        return str(rng.choice(INPUTS))
    if isinstance(value, bool):
        return str(not value).lower()
    factor = float(rng.choice([0.0, 0.1, 0.5, 0.9, 1.0, 1.1, 2.0, 10.0]))
    return str(round(value * factor) if isinstance(value, int) else value * factor)


def tries(
    count: int,
    seed: int = 0,
    seconds: float = 10.0,
    say: Callable[[str], None] = lambda _: None,
    workers: int = 1,
    prefix: str = "",
    *,
    command: Command,
) -> list[FuzzEnd]:
    """So many cases drawn at random, each run.

    seconds : of the processor that each may take without a word of progress; six times as many in all
    prefix : the beginning of the names of what is taken
    command : what `tribodyn` does with the words of a command line; it leaves by SystemExit"""
    rng, cases = np.random.default_rng(seed), []
    with TemporaryDirectory() as name:
        inputs = [base for base in bases(Path(name)) if base.kind.startswith(prefix)]
        jobs = [case(inputs[int(rng.integers(len(inputs)))], rng) for _ in range(count)]
        first = tuple(base.job() for base in inputs if not base.kind.startswith("plan"))
        for outcome in Runs(first, seconds, workers, command, 6 * seconds).of(jobs):
            cases.append(outcome)
            if not outcome.good or len(cases) % 50 == 0:
                say(f"{len(cases)} of {count}: {outcome.scene}: {outcome.key}: {outcome.end}: {outcome.output[-300:]}")
    return cases


def as_table(cases: Sequence[FuzzEnd]) -> str:
    """A row for each kind of input, and a line for each wrong end."""
    kinds: dict[str, list[FuzzEnd]] = {}
    for case in cases:
        kinds.setdefault(case.scene, []).append(case)
    ends = ("success", "refused", "failed", GOING)
    rows = [f"| what | cases | {' | '.join(ends)} | wrong | slowest | longest without a word |", "|---" * 9 + "|"]
    for kind, ours in [*sorted(kinds.items()), ("all", list(cases))]:
        counts = Counter(case.end for case in ours)
        cells = [str(counts[end]) for end in ends]
        wrong, slow, mute = (sum(not case.good for case in ours), *(max(getattr(case, of) for case in ours)
                             for of in ("seconds", "silent")))  # fmt: skip
        rows.append(f"| {kind} | {len(ours)} | {' | '.join(cells)} | {wrong} | {slow:.1f} s | {mute:.1f} s |")
    return "\n".join(rows + [f"{o.scene}: {o.key}: {o.end}: {o.output[-300:]}" for o in cases if not o.good])

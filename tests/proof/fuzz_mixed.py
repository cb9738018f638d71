"""Damage of several kinds at once: keys two and three together, tables, files of studies and fits, decks, matrices.

Each case is a text that something reads: a scene with its changes, a study, a search for an optimum, a fit, a deck of
three programs, or matrices. It is read, a deck inspected besides, and a scene planned. It ends well, is refused with
one sentence, or is wrong: another exception, a warning of a library, more than the seconds of the processor.
"""

from __future__ import annotations

import re
import time
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pyyeti.nastran import op4

from tests.helpers import foreign_files
from tests.helpers.pages import ROOT, fences
from tests.proof import fuzz
from tests.proof.time_limit import TimeUp, processor_seconds
from tribodyn.reduction.foreign import read_matrices
from tribodyn.workflows.run import planning
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies import inspection
from tribodyn.workflows.studies.fits import fit_file
from tribodyn.workflows.studies.many import study_file

READ, REFUSED = "read", "refused"


@dataclass(frozen=True)
class Tried:
    """One case. what : it is; end : read, refused, or what is wrong; said : the sentence; seconds : of the processor"""

    what: str
    changes: str
    end: str
    said: str
    seconds: float

    @property
    def good(self) -> bool:
        """Whether it ended as it may."""
        return self.end in (READ, REFUSED)


def lines_damaged(text: str, rng: np.random.Generator) -> tuple[str, str]:
    """A text with one to three damages to its lines, and what they are."""
    done = []
    for _ in range(rng.integers(1, 4)):
        lines = text.splitlines(keepends=True)
        if not lines:
            break
        i = int(rng.integers(len(lines)))
        kind = str(rng.choice(["gone", "doubled", "swapped", "cut off", "number", "character", "moved", "word"]))
        if kind == "gone":
            del lines[i]
        elif kind == "doubled":
            lines.insert(i, lines[i])
        elif kind == "swapped":
            j = int(rng.integers(len(lines)))
            lines[i], lines[j] = lines[j], lines[i]
        elif kind == "cut off":
            lines = [*lines[:i], lines[i][: int(rng.integers(len(lines[i]) + 1))]]
        elif kind == "number":
            value = str(rng.choice(["-1", "0", "1e300", "nan", "3.5", "99999999999", "1e-300", "x"]))
            found = list(re.finditer(r"[-+]?\d[\d.eE+-]*", lines[i]))
            if found:
                at = found[int(rng.integers(len(found)))]
                lines[i] = lines[i][: at.start()] + value + lines[i][at.end() :]
        elif kind == "character":
            j = int(rng.integers(len(lines[i])))
            lines[i] = lines[i][:j] + chr(int(rng.integers(1, 256))) + lines[i][j + 1 :]
        elif kind == "moved":
            lines.insert(int(rng.integers(len(lines))), lines.pop(i))
        else:
            words = lines[i].split(",")
            del words[int(rng.integers(len(words)))]
            lines[i] = ",".join(words).rstrip("\n") + "\n"
        text = "".join(lines)
        done.append(f"line {i + 1} {kind}")
    return text, ", ".join(done)


def tables_damaged(text: str, rng: np.random.Generator) -> tuple[str, str]:
    """A TOML text with a whole table gone, doubled or renamed."""
    parts = re.split(r"(?m)^(?=\[)", text)
    i = int(rng.integers(len(parts)))
    kind = str(rng.choice(["gone", "doubled", "renamed", "emptied"]))
    changed = {
        "gone": [],
        "doubled": [parts[i], parts[i]],
        "renamed": [re.sub(r"\[(\w)", r"[x\1", parts[i], count=1)],
        "emptied": [parts[i].split("\n")[0] + "\n"],
    }
    return "".join([*parts[:i], *changed[kind], *parts[i + 1 :]]), f"table {parts[i][:30].splitlines()[:1]} {kind}"


def _scene(name: str, rng: np.random.Generator) -> tuple[Callable[[], object], str]:
    """A shipped scene with two or three keys changed, or with damage to its text and a key."""
    texts, said = scene_file.find(name).read_text(encoding="utf-8"), ""
    if rng.random() < 0.5:
        texts, said = (tables_damaged if rng.random() < 0.5 else lines_damaged)(texts, rng)
    dump, every = scene_file.read(name).scene.model_dump(), fuzz.keys(name)
    if rng.random() < 0.6:
        every = [key for key in every if isinstance(_own(dump, key), bool | int | float)]
    keys = rng.choice(every, int(rng.integers(0 if said else 2, 4)), replace=False)
    changes = tuple(f"{key}={_value(_own(dump, str(key)), rng)}" for key in keys)
    place = scene_file.find(name).parent

    def read() -> object:
        file = scene_file.parse(texts, f"{name}.toml", changes, place)
        return planning.plan(file)

    return read, " ".join([said, *changes])


def _own(dump: Any, key: str) -> Any:
    """What a scene has at a key, None where it has nothing."""
    for word in key.split("."):
        dump = dump.get(word, (dump.get("parameters") or {}).get(word)) if isinstance(dump, dict) else None
    return dump


def _value(own: Any, rng: np.random.Generator) -> str:
    """A fuzz input for a key, or, more often, its own number somewhat changed or its switch the other way."""
    if rng.random() < 0.2 or not isinstance(own, bool | int | float):
        return str(rng.choice(fuzz.INPUTS))
    if isinstance(own, bool):
        return str(not own).lower()
    factor = float(rng.choice([0.0, 0.1, 0.5, 1.0, 2.0, 10.0]))
    return str(round(own * factor) if isinstance(own, int) else own * factor)


def _texts() -> dict[str, tuple[str, Callable[[Path], object]]]:
    """Files of studies, lives, optima and fits as the pages and the cases have them, with what reads each."""
    found: dict[str, tuple[str, Callable[[Path], object]]] = {}
    for page in ("study", "optimise", "lives"):
        for k, fence in enumerate(fences(ROOT / f"docs/howto/{page}.md")):
            if fence.language == "toml" and fence.word and "[vary" in fence.text:
                found[f"{page} {k}"] = fence.text, study_file.read
    fit = next(scene_file.CASES.glob("*/*.fit.toml"))
    found["fit"] = fit.read_text(encoding="utf-8"), fit_file.read
    return found


def _files(folder: Path) -> dict[str, tuple[str, Callable[[Path], object]]]:
    """Decks of three programs, and matrices in text, with what reads each."""
    mesh, found = foreign_files.bricks(folder), {}

    def look(path: Path) -> object:
        return inspection.inspect(path, unit="m", modes=2 if "*" in path.read_text(errors="replace") else 0)

    for ending in (".inp", ".bdf", ".cdb"):
        found[f"deck {ending}"] = foreign_files.write(mesh, folder / f"deck{ending}", "").read_text(), look
    lap = ROOT / "tests/geometry/decks/lap.inp"
    found["deck lap.inp"] = lap.read_text(encoding="utf-8"), look
    K = np.diag([2.0, 3.0, 4.0]) - np.eye(3, k=1) - np.eye(3, k=-1)
    op4.write(str(folder / "two.op4"), {"k": K, "m": np.eye(3)}, binary=False)
    found["matrices .op4"] = (folder / "two.op4").read_text(), read_matrices
    entries = [f"DMIG,{name},{j + 1},1,,{i + 1},1,{m[i, j]}" for name, m in (("K", K), ("M", np.eye(3)))
               for j in range(3) for i in range(j, 3)]  # fmt: skip
    found["matrices .pch"] = "\n".join(["DMIG,K,0,6,2,0,,,3", "DMIG,M,0,6,2,0,,,3", *entries, ""]), read_matrices
    rows = "".join(f"{i + 1},1,{j + 1},1,{K[i, j]}\n" for i in range(3) for j in range(i + 1))
    found["matrices .mtx"] = rows, lambda path: read_matrices(mass=path, stiffness=path)
    return found


def tries(count: int, seed: int = 0, seconds: float = 10.0, say: Callable[[str], None] = lambda _: None) -> list[Tried]:
    """So many cases drawn at random, each tried; half of them are scenes.

    seconds : of the processor that each may take
    """
    rng, found = np.random.default_rng(seed), []
    with TemporaryDirectory() as name:
        folder = Path(name)
        texts = {**_texts(), **_files(folder)}
        scenes = scene_file.names()
        for number in range(count):
            if number % 2 == 0:
                what = str(rng.choice(scenes))
                read, changes = _scene(what, rng)
            else:
                what = str(rng.choice(list(texts)))
                text, reader = texts[what]
                ending = re.search(r"\.\w+$", what)
                damage = tables_damaged if ending is None and rng.random() < 0.4 else lines_damaged
                text, changes = damage(text, rng)
                path = folder / f"damaged{ending[0] if ending else '.toml'}"
                path.write_bytes(text.encode("latin-1", "replace"))
                read = partial(reader, path)
            found.append(_try(what, changes, read, seconds))
            if not found[-1].good:
                say(f"{what}: {changes}: {found[-1].end}: {found[-1].said}")
    return found


def _try(what: str, changes: str, read: Callable[[], object], seconds: float) -> Tried:
    clock, end, said = time.process_time(), READ, ""
    try:
        with warnings.catch_warnings(), processor_seconds(seconds):
            warnings.simplefilter("error")
            read()
    except ValueError as error:
        end, said = REFUSED, str(error)
        if "\n" in said or not said or len(said) > 2000:
            end = "no single sentence"
        if _alien(error):
            end = f"a ValueError of a library, {_alien(error)}"
    except TimeUp:
        end = f"longer than {seconds:g} s"
    except Warning as warning:
        end, said = "a warning of a library", repr(warning)
    except Exception as error:
        end, said = "traceback", f"{type(error).__name__}: {error} at {_alien(error)}"
    return Tried(what, changes, end, said, time.process_time() - clock)


def _alien(error: BaseException) -> str:
    """Where an exception was raised, if not in this tree."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    file = "" if trace is None else trace.tb_frame.f_code.co_filename
    own = "site-packages" not in file and ("tribodyn" in file or str(ROOT) in file)  # the environment lies in the tree
    if not own or not isinstance(error, ValueError):
        return f"{Path(file).name}:{trace.tb_lineno if trace else 0}"
    return ""


def as_table(tried: Sequence[Tried]) -> str:
    """A row for each kind of file, and a line for each wrong end."""
    kinds: dict[str, list[Tried]] = {}
    for one in tried:
        kind = one.what.split()[0] if " " in one.what else "fit" if one.what == "fit" else "scene"
        kinds.setdefault(kind, []).append(one)
    rows = ["| what | cases | read | refused with a sentence | wrong | slowest |", "|---|---|---|---|---|---|"]
    for kind, ours in sorted(kinds.items()):
        ends = Counter(one.end for one in ours)
        wrong = sum(not one.good for one in ours)
        slowest = max(one.seconds for one in ours)
        rows.append(f"| {kind} | {len(ours)} | {ends[READ]} | {ends[REFUSED]} | {wrong} | {slowest:.1f} s |")
    return "\n".join(rows + [f"{o.what} {o.changes}: {o.end}: {o.said[:300]}" for o in tried if not o.good])

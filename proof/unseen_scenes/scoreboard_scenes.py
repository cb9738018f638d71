"""Scenes drawn at random for the scoreboard: families of parts with random sizes, contacts, loads, damping, harmonics.

What makes a scene worth its run is not drawn but set: the range of the response holds the first resonance, free and
stuck, and the vibration force is that at which the stuck contact would carry a drawn multiple of what friction can."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg as sla

from proof import bracket
from tests.helpers.matrix_scene import masses
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.workflows.run import modelling, references, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile, parse

Table = dict[str, Any]
WIDEST = 4.0  # highest over lowest frequency of a response
STEEL = {"young": "210 GPa", "density": "7860 kg/m3", "poisson": 0.3}
MODES = 6  # stuck modes that the resonance is looked for in
WORN = {"parts": 0.5, "wear": 1.0, "masses": 0.0}  # share of the scenes that are worn
# logarithm of the tangential force of the stuck contact over what friction can carry; with little of it wear fades
# out before the contact is lost
DRIVE, WEARING = (-0.2, 0.8), (0.4, 1.0)
LOST = 0.05  # share of the preload where a life ends: the rest lasts two to four times as long, on every mesh otherwise
# frequencies at which they wear, over the resonance of the free part: half of them well below, where more motions stay
SPREADS = ((0.4, 0.6), (0.4, 0.6), (0.85, 0.95), (1.05, 1.15))
# where all scenes wear
IN_TIME: Table = {"rule": "error_controlled", "tolerance": 0.03, "motion": "time", "max_steps": 400}
TOPS = (1, 1, 2, 3, 3, 5)  # highest harmonic kept
HIGHEST = {"wheel": 3, "rig": 3}  # the same, at most: with more their reference takes minutes
# times the drawn damping where they wear, and of rigs: with little of it most such motions are unstable
DAMPED = 2.0


@dataclass(frozen=True)
class Drawn:
    """A scene as text, and what it was drawn from."""

    number: int
    seed: int
    family: str
    text: str

    def file(self, folder: Path, overrides: tuple[str, ...] = ()) -> SceneFile:
        """The scene, checked."""
        return parse(self.text, f"{self.family}_{self.number}.toml", overrides, folder)


def draw(number: int, seed: int, folder: Path, kind: str = "parts") -> Drawn:
    """Scene `number` of a seed; the families of a kind come in turn.

    kind : see `KINDS`; of "parts" some are worn, along the motion of the balance
    Raises  ValueError, RuntimeError where it has no resonance"""
    rng = np.random.default_rng([seed, number])
    family, wearing = KINDS[kind][number % len(KINDS[kind])], kind == "wear"
    tables = FAMILIES[family](rng)
    shutil.copy(bracket.__file__, folder)
    table: Table = {"scene": {"title": f"{family} {number} of seed {seed}"}} | tables
    table |= _common(rng, HIGHEST.get(family, TOPS[-1]))
    if family == "masses":
        np.savez(folder / table["model"]["file"], **table.pop("matrices"))
    else:
        table |= {"materials": {"steel": STEEL}} if "bodies" in table else {"material": STEEL}
    if family not in ("wheel", "masses"):
        table["reduction"] = {"modes": int(rng.integers(5, 16))}
    guess: Table = {"frequency": [1.0, 1e5], "points": 10}
    text = as_toml(table | {"response": table["response"] | guess})
    balance = modelling.build(parse(text, "drawn.toml", (), folder), Progress()).balance
    worn, at = bool(rng.uniform() < WORN[kind]), float(rng.uniform(*SPREADS[int(rng.integers(len(SPREADS)))]))
    drive = float(10 ** rng.uniform(*(WEARING if worn else DRIVE)))
    low, high, place, force = _operating_range(balance, drive, at if worn else None)
    table["response"] |= {"frequency": [low, high], "points": int(rng.choice([30, 50]))}
    table["loads"]["harmonic"]["shake"]["value"] = force
    if worn:
        table["wear"] = {"coefficient": "1e4 um3/J", "max_steps": 80, "lost_below": LOST}
        table["wear"] |= IN_TIME if wearing else _rule(rng)
        table["wear"] |= {"at": {"frequency": place}}
    if worn or family == "rig":
        table["damping"]["modal"] *= DAMPED
    return Drawn(number, seed, family, as_toml(table))


def _rule(rng: np.random.Generator) -> Table:
    if rng.uniform() < 0.8:
        return {"rule": "error_controlled", "tolerance": float(rng.choice([0.02, 0.05, 0.1]))}
    return {"rule": "thesis", "step": "5 %"}


def _common(rng: np.random.Generator, highest: int) -> Table:
    top = min(int(rng.choice(TOPS)), highest)
    return {
        "harmonics": {"kept": list(range(top + 1)), "samples": 64, "transitions": "located"},
        "damping": {"modal": float(np.exp(rng.uniform(np.log(0.002), np.log(0.03))))},
    }


def _contact(rng: np.random.Generator, stiffness: float, vertices_only: bool | None = None) -> Table:
    """stiffness : tangential, of the whole contact [N/m], about which it is drawn."""
    tangential = stiffness * float(10 ** rng.uniform(-0.7, 0.5))
    corners = bool(rng.uniform() < 0.5) if vertices_only is None else vertices_only
    return {
        "t1": "x",
        "vertices_only": corners,
        "tangential_stiffness": tangential,
        "normal_stiffness": tangential * float(rng.uniform(1.0, 1.5)),
        "friction": float(rng.uniform(0.1, 0.8)),
    }


def _lengths(rng: np.random.Generator, **bounds: tuple[float, float]) -> dict[str, float]:
    return {name: round(float(rng.uniform(*pair)), 5) for name, pair in bounds.items()}


def _pressed(top: str, driven: str, output: str, direction: str, rng: np.random.Generator) -> Table:
    """Loads and response of a part that is pressed on the ground at its end and shaken along a direction."""
    return {
        "loads": {
            "static": {"press": {"group": top, "direction": "-z", "value": float(10 ** rng.uniform(2, 4))}},
            "harmonic": {"shake": {"group": driven, "direction": direction, "value": 1.0}},
        },
        "response": {"group": output, "direction": direction},
    }


def _beam(rng: np.random.Generator) -> Table:
    sizes = _lengths(rng, length=(0.12, 0.3), width=(0.015, 0.03), height=(0.012, 0.03), patch_length=(0.015, 0.03))
    counts = {"n_patch": int(rng.choice([3, 5])), "n_length": int(rng.integers(6, 11)), "n_height": 1}
    corners = True if counts["n_patch"] > 3 else None  # the reference has some 40 pairs at most
    return {
        "geometry": {"part": "beam", "fixed": ["clamp"], **sizes, **counts},
        "contact": {"group": "contact", **_contact(rng, 1e8, corners)},
        **_pressed("static_load", "shaker", "response", "y", rng),
    }


def _block(rng: np.random.Generator, sizes: dict[str, float], counts: dict[str, int], stiffness: float) -> Table:
    """A block that is clamped at one end, with a pad below the other."""
    pad = float(rng.uniform(0.12, 0.3)) * sizes["length"]
    strip = {"pad_start": sizes["length"] - pad, "pad_end": sizes["length"]}
    return {
        "geometry": {"part": "block", "fixed": ["x_min"], **sizes, **counts, **strip},
        "contact": {"group": "pad_min", **_contact(rng, stiffness, vertices_only=counts["n_width"] > 1 or None)},
        **_pressed("pad_max", "pad_max", "pad_max", "y", rng),
    }


def _plate(rng: np.random.Generator) -> Table:
    sizes = _lengths(rng, length=(0.1, 0.2), width=(0.06, 0.12), height=(0.003, 0.008))
    return _block(
        rng, sizes, {"n_length": int(rng.integers(7, 11)), "n_width": int(rng.integers(2, 4)), "n_height": 1}, 3e7
    )


def _arm(rng: np.random.Generator) -> Table:
    sizes = _lengths(rng, length=(0.15, 0.35), width=(0.01, 0.02), height=(0.01, 0.02))
    return _block(rng, sizes, {"n_length": int(rng.integers(8, 15)), "n_width": 1, "n_height": 1}, 2e7)


def _bracket(rng: np.random.Generator) -> Table:
    sizes = _lengths(
        rng, length=(0.07, 0.14), height=(0.04, 0.08), width=(0.025, 0.04), thickness=(0.006, 0.012),
        hole=(0.006, 0.01), pad_length=(0.015, 0.025),
    )  # fmt: skip
    counts = {"n_length": int(rng.integers(6, 10)), "holes": int(rng.integers(0, 4))}
    return {
        "geometry": {"part": "bracket.py", "fixed": ["back"], **sizes, **counts},
        "contact": {"group": "pad", **_contact(rng, 5e7, vertices_only=True)},
        **_pressed("top", str(rng.choice(["end", "side"])), "top", "y", rng),
    }


def _wheel(rng: np.random.Generator) -> Table:
    sectors = int(rng.integers(4, 41))
    order = int(rng.integers(1, max(2, min(sectors // 2, 6))))
    hub = sectors * 0.3 / 40 * float(rng.uniform(0.9, 1.3)) + 0.02
    sizes = _lengths(rng, span=(0.16, 0.24), root_thickness=(0.016, 0.022), tip_thickness=(0.011, 0.015))
    counts = {"n_along": int(rng.choice([2, 3])), "n_up": 2, "n_span": int(rng.integers(4, 6)), "n_side": 1}
    couple = float(10 ** rng.uniform(4.0, 4.8))
    return {
        "geometry": {
            "part": "blade", "fixed": ["clamp"], "n_blades": sectors, "hub_radius": hub,
            "shroud_angle": f"{rng.integers(-60, -40)} deg", **sizes, **counts,
        },
        "wheel": {"sectors": sectors, "engine_order": order, "axis": "x"},
        "contact": {"group": "shroud_right", "opposite": "shroud_left", **_contact(rng, 9e7, vertices_only=True)},
        "loads": {
            "static": {
                "trailing": {"group": "couple_trailing", "direction": "-y", "value": couple},
                "leading": {"group": "couple_leading", "direction": "y", "value": couple},
            },
            "harmonic": {"shake": {"group": "excitation", "direction": "y", "value": 1.0}},
        },
        "response": {"group": "tip", "direction": "y"},
        "reduction": {"cutoff": float(rng.choice([6e3, 10e3, 15e3]))},
    }  # fmt: skip


def _rig(rng: np.random.Generator) -> Table:
    """A clamped block and a shorter one that lies on it, held by springs alone and pressed on, as in a fretting rig."""
    base = _lengths(rng, length=(0.08, 0.14), width=(0.02, 0.04), height=(0.01, 0.02))
    mover = base | _lengths(rng, length=(0.02, 0.05), height=(0.008, 0.02))
    fine = int(rng.integers(3, 5))
    pad = {"pad_start": base["length"] - mover["length"], "pad_end": base["length"]}
    pressed = float(10 ** rng.uniform(2, 3.7))
    spring = float(10 ** rng.uniform(5, 6.5))
    divisions = {"n_length": round(fine * base["length"] / mover["length"]), "n_width": 1, "n_height": 1}
    spring_of = {"group": "mover.z_max", "stiffness": spring}
    return {
        "bodies": {
            "base": {"part": "block", "material": "steel", "fixed": ["x_min"], **base, **pad, **divisions},
            "mover": {
                "part": "block", "material": "steel", **mover, "n_length": fine, "n_width": 1, "n_height": 1,
                "translation": [pad["pad_start"], 0.0, base["height"]],
            },
        },
        "contacts": {
            "joint": {"first": "mover.z_min", "second": "base.pad_max", **_contact(rng, 3e7, vertices_only=True)}
        },
        "springs": {f"hold_{axis}": spring_of | {"direction": axis} for axis in "xyz"},
        "loads": {
            "static": {"press": {"group": "mover.z_max", "direction": "-z", "value": pressed}},
            "harmonic": {"shake": {"group": "mover.x_max", "direction": "x", "value": 1.0}},
        },
        "response": {"group": "mover.z_max", "direction": "x"},
    }  # fmt: skip


FAMILIES: dict[str, Callable[[np.random.Generator], Table]] = {
    "beam": _beam, "plate": _plate, "arm": _arm, "bracket": _bracket, "wheel": _wheel, "rig": _rig,
    "masses": partial(masses, contact=_contact),
}  # fmt: skip
KINDS = {"parts": tuple(FAMILIES)[:-1], "wear": ("beam", "plate", "arm", "bracket", "rig"), "masses": ("masses",)}


def _operating_range(balance: HarmonicBalance, drive: float, at: float | None) -> tuple[float, float, float, float]:
    """Range of the response [Hz], its lower and upper end, a frequency in it [Hz], and the force [N].

    drive : tangential force of the stuck contact over what friction can carry, at that frequency
    at : the frequency over the resonance of the free part; None: the highest resonance of the stuck one"""
    system, b = balance.model.at_harmonic(1)
    free, stuck_modes = (
        np.sqrt(np.abs(sla.eigh(k, system.mass, eigvals_only=True, subset_by_index=(0, min(MODES, len(k)) - 1))))
        for k in (system.stiffness, stuck_stiffness(system.stiffness, b, balance.contact.stiffness))
    )
    curves = references.linear_references(
        balance, settings.OUTPUT, 0.5 * float(stuck_modes[0]), 1.1 * float(stuck_modes[-1])
    )
    stuck = float(curves.omega[int(np.argmax(curves.stuck))])
    lower = free[free < stuck]
    loose = float(lower[-1]) if len(lower) and lower[-1] > stuck / WIDEST else stuck / 1.5
    place = stuck if at is None else at * loose
    at_rest, moving = balance.x_lin(place), balance.contact.stiffness.ravel()
    x = np.abs(at_rest.reshape(len(moving), -1))
    normal = np.zeros(len(moving), bool)
    normal[2::3] = True
    load = at_rest.reshape(len(moving), -1)[normal, 0] * moving[normal]
    shaken = np.linalg.norm(x[~normal, 1:3], axis=1) * moving[~normal]
    carried = balance.contact.joints[0].parameters.numbers["friction"] * np.clip(load, 0, None)
    if not load.sum() > 0 or not shaken.sum() > 0:
        raise ValueError("the static load opens the contact, or the vibration does not reach it")
    force = drive * float(carried.sum()) / float(np.hypot(shaken[::2], shaken[1::2]).sum())
    turn = 2 * np.pi
    return min(0.6 * loose, 0.9 * place) / turn, 1.2 * stuck / turn, place / turn, force


def as_toml(table: Table) -> str:
    """A table of tables as TOML; lists and scalars as JSON writes them, which is TOML too."""
    lines: list[str] = []

    def put(path: tuple[str, ...], current: Table) -> None:
        values = {key: value for key, value in current.items() if not isinstance(value, dict)}
        if values:
            lines.append(f"[{'.'.join(path)}]")
            lines.extend(f"{key} = {json.dumps(value)}" for key, value in values.items())
        for key, value in current.items():
            if isinstance(value, dict):
                put((*path, key), value)

    put((), table)
    return "\n".join(lines) + "\n"

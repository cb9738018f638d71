"""The words that are made from studies; each study is imported when its word is used."""

from importlib import import_module
from typing import Any

from tribodyn.workflows.command.word import Into, group, word

STUDIES: dict[str, tuple[str, str, Into]] = {  # words -> module and function of the study, folder of its files
    "new": ("draft", "draft", "here"),
    "inspect": ("inspection", "inspect", "asked"),
    "verify": ("verification", "verify", "pictures"),
    "curve backbone": ("curves.backbones", "backbone", "results"),
    "curve ring-down": ("curves.decay", "ring_down", "results"),
    "wheel modes": ("wheels.wheel_modes", "modes", "results"),
    "wheel flutter": ("wheels.flutter", "flutter", "results"),
    "wheel mistuned": ("wheels.unequal_sectors", "mistuned", "results"),
    "wheel patterns": ("wheels.patterns", "patterns", "results"),
    "study grid": ("many.study_runs", "grid", "results"),
    "study lives": ("many.lives", "lives", "results"),
    "study optimise": ("many.optimum", "optimise", "results"),
    "study identify": ("fits.scene_fit", "identify", "results"),
    "study derivatives": ("response_derivatives", "derivatives", "results"),
    "study converge": ("convergence", "converge", "results"),
    "study forces": ("forces", "forces", "results"),
    "study compare": ("measured.compare", "compare", "results"),
    "study test": ("measured.wear_test", "replay", "results"),
    "study loops": ("measured.measured_loops", "loops", "results"),
    "study worn": ("scans.worn_scans", "worn", "asked"),
}


def __getattr__(name: str) -> Any:
    """The word of this name, or all words of the group of this name."""
    made = [
        word(getattr(import_module(f"tribodyn.workflows.studies.{module}"), function), words, into=into)
        for words, (module, function, into) in STUDIES.items()
        if words.split()[0] == name
    ]
    if not made:
        raise AttributeError(f"there is no word {name}")
    return made[0] if name in STUDIES else group(name, *made)

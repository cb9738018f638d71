"""A deck of two blocks one upon the other, and the text of a scene with it."""

from tests.helpers.pages import ROOT

BESIDE = "          0.,           0.,          10.\n          0.,"  # where the second block stands in the file
TEXT = (ROOT / "tests/geometry/decks/lap.inp").read_text(encoding="utf-8").replace(BESIDE, "0., -10., 10.\n 0.,")
REST = """
[scene]
title = "A deck"
[loads.harmonic.shake]
group = "Block-2"
direction = "y"
value = "1 N"
[response]
group = "Block-2"
direction = "y"
frequency = ["1 kHz", "2 kHz"]
[reduction]
modes = 4
"""
OWN = '[decks.lap]\nfile = "lap.inp"\nunit = "mm"\n'

"""Colours, fonts and sizes that all pictures share: change them here.

Line and status colours are those of Okabe and Ito (2008),
maps are viridis and cividis: readable with any colour vision.
"""

from __future__ import annotations

from typing import Any

from tribodyn.hbm.contact.law import SEPARATES, SLIPS, STICKS

BLUE, ORANGE, GREEN, RED, GREY, INK = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#7f858e", "#22262d"
SKY, YELLOW, PALE, PAPER = "#56b4e9", "#f0e442", "#b9bec6", "white"
BODY, BODY_2, EDGE = "#c9ced6", "#a9b4c4", "#4a515c"
BODIES = (BODY, BODY_2, "#d9cfc0", "#b7c4b1")
WEAR_MAP, PRESSURE_MAP, MOTION_MAP = "viridis", "cividis", "viridis"
CYCLE = (BLUE, ORANGE, GREEN, RED, SKY, GREY)

STATUS = {
    STICKS: ("stick", BLUE),
    STICKS | SLIPS: ("stick-slip", SKY),
    SLIPS: ("slip", ORANGE),
    STICKS | SEPARATES: ("stick-separation", GREEN),
    STICKS | SLIPS | SEPARATES: ("stick-slip-separation", YELLOW),
    SLIPS | SEPARATES: ("slip-separation", RED),
    SEPARATES: ("separation", PALE),
}

FORMATS = ("png", "pdf", "svg")
DPI = 200

STYLE: dict[str, Any] = {
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "font.family": ["STIXGeneral", "DejaVu Serif"],  # come with matplotlib; look like the text of a paper
    "mathtext.fontset": "stix",
    "pdf.fonttype": 42,  # text stays text
    "svg.fonttype": "path",
    "font.size": 11,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlesize": 12,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#dfe2e6",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "legend.fontsize": 10,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
}

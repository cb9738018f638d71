"""Colours and fonts that all pictures share."""

from __future__ import annotations

from typing import Any

from tribodyn.hbm.law import SEPARATES, SLIPS, STICKS

BLUE, ORANGE, GREEN, RED, GREY, INK = "#2f6db3", "#e08214", "#3a923a", "#c03d3e", "#8a8f98", "#22262d"
WEAR_MAP, PRESSURE_MAP = "viridis", "inferno"

STATUS = {
    STICKS: ("stick", BLUE),
    STICKS | SLIPS: ("stick-slip", "#7db8e8"),
    SLIPS: ("slip", ORANGE),
    STICKS | SEPARATES: ("stick-separation", GREEN),
    STICKS | SLIPS | SEPARATES: ("stick-slip-separation", "#a3d492"),
    SLIPS | SEPARATES: ("slip-separation", RED),
    SEPARATES: ("separation", "#b9bec6"),
}

STYLE: dict[str, Any] = {
    "figure.dpi": 150,
    "savefig.dpi": 150,
    "font.size": 10,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#dfe2e6",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.7,
    "legend.frameon": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
}

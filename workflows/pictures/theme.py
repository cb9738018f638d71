"""Colours, fonts and sizes that all pictures share: change them here.

Line and status colours are those of Okabe and Ito (2008),
maps are viridis and cividis: readable with any colour vision."""

from dataclasses import dataclass
from typing import Any

from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS

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


@dataclass(frozen=True)
class Layout:
    """Layout of pictures.

    font, line : points of all text and of all curves
    dpi : dots per inch of figures, film_dpi : of films
    narrowest : inches of a figure of maps, below which a legend of all states does not fit
    column, least : inches of a column of views, and of the narrowest figure of them
    view : pixels of a view of the part, wheel : of a wheel, book : of an opened contact, scene : of a scene not yet run
    film : inches of a film; film_part, film_contact : pixels of the views in it; rate : images per second of a film
    images : of a film, fewer where there are fewer wear steps; samples : instants of a cycle in maps of its motion
    instants : of a cycle, among which that of the largest swing is found
    ringed : of the width of a view, below which a contact is ringed
    smooth : subdivisions of the faces of curved elements
    lift : of the size of a contact, by which colours lie above it
    sunk : of the thinnest body, by which bodies that slide are drawn into each other at most"""

    dpi: int = 200
    font: float = 10.0
    line: float = 1.3
    film_dpi: int = 100
    narrowest: float = 5.6
    column: float = 3.4
    least: float = 6.0
    view: tuple[int, int] = (900, 760)
    book: tuple[int, int] = (900, 690)
    scene: tuple[int, int] = (1100, 760)
    wheel: tuple[int, int] = (1000, 1000)
    groups: tuple[int, int] = (1700, 680)
    film: tuple[float, float] = (12.8, 7.2)
    film_part: tuple[int, int] = (760, 560)
    film_contact: tuple[int, int] = (640, 490)
    rate: float = 12.0
    images: int = 48
    samples: int = 256
    instants: int = 64
    ringed: float = 0.07
    smooth: int = 2
    lift: float = 4e-3
    sunk: float = 0.1


LAYOUT = Layout()

STYLE: dict[str, Any] = {
    **dict.fromkeys(("figure.dpi", "savefig.dpi"), LAYOUT.dpi),
    **dict.fromkeys(("font.size", "axes.titlesize", "figure.titlesize", "legend.fontsize"), LAYOUT.font),
    **dict.fromkeys(("axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color", "text.color"), INK),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right", "legend.frameon"), False),
    **dict.fromkeys(("axes.grid", "axes.axisbelow"), True),
    "font.family": ["STIXGeneral", "DejaVu Serif"],  # come with matplotlib; look like the text of a paper
    "mathtext.fontset": "stix",
    "pdf.fonttype": 42,  # text stays text
    "svg.fonttype": "path",
    "axes.titlelocation": "left",
    "grid.color": "#dfe2e6",
    "grid.linewidth": 0.6,
    "lines.linewidth": LAYOUT.line,
}

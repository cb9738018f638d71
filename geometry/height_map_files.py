"""Read a measured height map from a file; its format is recognised by content, else by the ending of its name.

Text:    x y z on each line (any order, a point may be missing), or a matrix of heights, one profile along x per line
SDF:     ISO 25178-71, see read_sdf
others:  .sur .plu .plux .al3d .x3p .vk4 .opd ... through the package surfalize (GPL-3), if it is installed"""

import re
import struct
from pathlib import Path

import numpy as np

from tribodyn.extras import package
from tribodyn.geometry.height_map import HeightMap
from tribodyn.refusal import Refusal
from tribodyn.text_file import text_of

TEXT_ENDINGS = (".txt", ".xyz", ".csv", ".asc", ".dat", ".tsv", ".prn")
"""Endings read as text; others that are not SDF go to surfalize."""
MAGIC = re.compile(rb"([aAbB])([A-Z]{2,4}-V?\d\.\d)")
TYPES = {0: "<u1", 1: "<u2", 2: "<u4", 3: "<f4", 4: "<i1", 5: "<i2", 6: "<i4", 7: "<f8"}
"""Stored types by the DataType of the header."""
LARGE = {"<f4": 3.4e38, "<f8": 1.7e308}
"""Floating numbers of BCR from which on a point counts as not measured."""
Header = dict[str, float]


def read(
    path: str | Path, *, spacing: tuple[float, float] | None = None, lateral_unit: float = 1.0, height_unit: float = 1.0
) -> HeightMap:
    """Read a height map in metres.

    spacing : steps along x and y of a matrix text, in lateral units; None for text with x y z
    lateral_unit, height_unit : metres per unit of a text, 1e-6 for micrometres; other formats know their units
    Raises  Refusal: no such file, an empty one, not a regular grid, a reader that is not installed"""
    path = Path(path)
    if not path.is_file():
        raise Refusal(f"there is no height map {path}: check the name and the folder")
    with path.open("rb") as stream:
        head = stream.read(16)
    if not head:
        raise Refusal(f"{path.name} is empty: export the height map again")
    is_text = path.suffix.lower() in TEXT_ENDINGS and not looks_like_sdf(head)
    if not is_text and (spacing is not None or lateral_unit != 1.0 or height_unit != 1.0):
        raise Refusal(f"{path.name} carries its own units: leave out spacing, lateral_unit and height_unit")
    if looks_like_sdf(head):
        return read_sdf(path)
    if not is_text:
        return _through_surfalize(path)
    table = _numbers(path)
    if spacing is None:
        if table.shape[1] != 3:
            raise Refusal(f"{path.name} has {table.shape[1]} columns, not x y z: give spacing if it is a matrix")
        x, y, z = _gridded(table, path.name)
    else:
        if not (len(spacing) == 2 and min(spacing) > 0):
            raise Refusal(f"spacing of {path.name} is {spacing}: give two positive steps, along x and along y")
        z = table.T
        x, y = (np.arange(n) * step for n, step in zip(z.shape, spacing, strict=True))
    return HeightMap(x * lateral_unit, y * lateral_unit, z * height_unit, path.name)


def _numbers(path: Path) -> np.ndarray:
    """Rows of numbers; heads and comments before them are passed over; words for a missing height become NaN."""
    text = text_of(path)
    # with semicolons between fields a comma is a decimal point
    text = text.replace(",", ".").replace(";", " ") if ";" in text else text.replace(",", " ")
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith(("#", "%", "*", '"')):
            continue
        try:
            rows.append([_number(word) for word in words])
        except ValueError:
            if rows:
                raise Refusal(f"{path.name} has words in line {number}, after its first heights") from None
    if not rows:
        raise Refusal(f"{path.name} holds no numbers: is it a height map?")
    widths = {len(row) for row in rows}
    if len(widths) > 1:
        raise Refusal(f"{path.name} has lines of {min(widths)} to {max(widths)} numbers: all must be equally long")
    return np.array(rows)


def _number(word: str) -> float:
    return np.nan if word.upper() in ("BAD", "***", "---", "N/A", "NO_DATA") else float(word)


def _gridded(table: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Axes and heights (nx, ny) from scattered rows x y z of a regular grid; points that are not listed are NaN."""
    if not np.isfinite(table[:, :2]).all():
        raise Refusal(f"{name} has coordinates that are not numbers")
    axes, places = [], []
    for values in table[:, :2].T:
        ordered = np.unique(values)
        if len(ordered) < 2:
            raise Refusal(f"{name} has a single value in x or y: a height map needs a grid")
        steps = np.diff(ordered)
        step = np.median(steps[steps > 1e-3 * steps.max()])
        count = round((ordered[-1] - ordered[0]) / step) + 1
        place = np.rint((values - ordered[0]) / step).astype(int)
        if np.abs((values - ordered[0]) / step - place).max() > 0.05 or count > 10 * len(table):
            raise Refusal(f"{name} has points off a regular grid of step {step:g}: resample it to a grid")
        axes.append(np.linspace(ordered[0], ordered[-1], count))
        places.append(place)
    cells = places[0] * len(axes[1]) + places[1]
    if len(np.unique(cells)) < len(cells):
        raise Refusal(f"{name} lists a point of the grid twice")
    z = np.full(len(axes[0]) * len(axes[1]), np.nan)
    z[cells] = table[:, 2]
    return axes[0], axes[1], z.reshape(len(axes[0]), len(axes[1]))


def _through_surfalize(path: Path) -> HeightMap:
    surfalize = package("surfalize")
    try:
        surface = surfalize.Surface.load(path)
    except Exception as problem:  # the readers raise what they meet
        raise Refusal(f"{path.name} cannot be read by surfalize: {problem}") from None
    z = np.asarray(surface.data, float).T * 1e-6  # surfalize works in micrometres
    x, y = (np.arange(n) * step * 1e-6 for n, step in zip(z.shape, (surface.step_x, surface.step_y), strict=True))
    return HeightMap(x, y, z, path.name)


def looks_like_sdf(head: bytes) -> bool:
    """Whether the first bytes of a file are those of a surface data file."""
    return MAGIC.match(head.removeprefix(b"\xef\xbb\xbf")) is not None


def read_sdf(path: Path) -> HeightMap:
    """Read a surface data file: ISO 25178-71 (versions 1.0 and 2.0) and their forerunner BCR-1.0, text and binary.

    A file is a header, the heights as whole profiles along x, and a trailer that is not read. Heights are stored
    numbers times Zscale, in metres. A point without height is BAD in text; else it is the smallest number of its type
    in ISO, the largest in BCR. The first profile is at y = 0 in ISO; BCR leaves it open and is read as MountainsMap
    shows it, the first profile at the largest y.

    Raises  Refusal: compressed data, a missing header line, a size that differs from the header"""
    content = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
    magic = MAGIC.match(content)
    if magic is None:
        raise Refusal(f"{path.name} is not a surface data file: it must begin with aISO-1.0 or its kin")
    version = magic[2].decode()
    if magic[1] in b"aA":
        header, raw = _text(content, path.name)
    else:
        header, raw = _binary(content, version, path.name)
    n_x, n_y = int(header["numpoints"]), int(header["numprofiles"])
    if raw.size != n_x * n_y:
        raise Refusal(f"{path.name} holds {raw.size} heights but announces {n_x} x {n_y}: is it complete?")
    if not (header["xscale"] > 0 and header["yscale"] > 0 and header["zscale"] != 0):
        raise Refusal(f"{path.name} has a scale of zero: a height map needs Xscale, Yscale and Zscale")
    missing = ~np.isfinite(raw)
    stored = TYPES.get(int(header["datatype"]))
    if stored is None:
        raise Refusal(f"{path.name} has DataType {header['datatype']:g}: the types 0 to 7 are known")
    from_above = version.startswith("BC")
    if from_above:
        missing |= raw >= (LARGE.get(stored) or np.iinfo(stored).max)
    else:
        missing |= raw == (np.finfo(stored).min if stored in LARGE else np.iinfo(stored).min)
    heights = np.where(missing, np.nan, raw).reshape(n_y, n_x) * header["zscale"]
    if from_above:
        heights = heights[::-1]
    x, y = np.arange(n_x) * header["xscale"], np.arange(n_y) * header["yscale"]
    return HeightMap(x, y, heights.T.copy(), path.name)


def _text(content: bytes, name: str) -> tuple[Header, np.ndarray]:
    records = re.split(r"^\s*\*\s*$", content.decode("ascii", errors="replace"), flags=re.MULTILINE)
    if len(records) < 2:
        raise Refusal(f"{name} has no line with a star between header and heights: is it complete?")
    pairs = (line.split(";")[0].partition("=") for line in records[0].splitlines()[1:])
    entries = {key.strip().lower(): value.strip() for key, _, value in pairs}
    header: Header = {}
    for key in ("NumPoints", "NumProfiles", "Xscale", "Yscale", "Zscale", "DataType", "Compression"):
        try:
            header[key.lower()] = _finite(entries.get(key.lower(), ""))
        except ValueError:
            raise Refusal(f"{name} lacks a number for {key} in its header") from None
    if header["compression"]:
        raise Refusal(f"{name} is compressed: write it uncompressed")
    words = re.sub(r";.*", "", records[1]).upper().replace("BAD", "NAN").split()
    try:
        return header, np.array(words, dtype=float)
    except ValueError:
        raise Refusal(f"{name} has heights that are not numbers") from None


def _finite(word: str) -> float:
    number = float(word)
    if not np.isfinite(number):
        raise Refusal(f"{word} is no finite number")
    return number


def _binary(content: bytes, version: str, name: str) -> tuple[Header, np.ndarray]:
    count = "I" if version == "ISO-2.0" else "H"
    layout = struct.Struct(f"<8s10s12s12s{count}{count}4d3B")
    if len(content) < layout.size:
        raise Refusal(f"{name} ends within its header: is it complete?")
    n_x, n_y, x_scale, y_scale, z_scale, _, compression, kind, _ = layout.unpack_from(content)[4:]
    if compression or kind not in TYPES:
        raise Refusal(f"{name} is compressed or has the unknown DataType {kind}: write it plain, types 0 to 7")
    available = (len(content) - layout.size) // np.dtype(TYPES[kind]).itemsize
    raw = np.frombuffer(content, TYPES[kind], min(n_x * n_y, available), layout.size).astype(float)
    keys = ("numpoints", "numprofiles", "xscale", "yscale", "zscale", "datatype")
    return dict(zip(keys, (n_x, n_y, x_scale, y_scale, z_scale, kind), strict=True)), raw

"""Surface data files: ISO 25178-71 (versions 1.0 and 2.0) and their forerunner BCR-1.0, as text and binary.

A file is a header, the heights as whole profiles along x, and a trailer that is not read. Heights are stored numbers
times Zscale, in metres. A point without height is BAD in text; else it is the smallest number of its type in ISO, the
largest in BCR. The first profile is at y = 0 in ISO; BCR leaves it open and is read as MountainsMap shows it, the first
profile at the largest y.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np

from tribodyn.geometry.surface import HeightMap

MAGIC = re.compile(rb"([aAbB])([A-Z]{2,4}-V?\d\.\d)")

TYPES = {0: "<u1", 1: "<u2", 2: "<u4", 3: "<f4", 4: "<i1", 5: "<i2", 6: "<i4", 7: "<f8"}
"""Stored types by the DataType of the header."""

LARGE = {"<f4": 3.4e38, "<f8": 1.7e308}
"""Floating numbers of BCR from which on a point counts as not measured."""


def looks_like(head: bytes) -> bool:
    """Whether the first bytes of a file are those of a surface data file."""
    return MAGIC.match(head.removeprefix(b"\xef\xbb\xbf")) is not None


def read(path: Path) -> HeightMap:
    """Read a surface data file.

    Raises  ValueError: compressed data, a missing header line, a size that differs from the header
    """
    content = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
    magic = MAGIC.match(content)
    if magic is None:
        raise ValueError(f"{path.name} is not a surface data file: it must begin with aISO-1.0 or its kin")
    version = magic[2].decode()
    if magic[1] in b"aA":
        header, raw = _text(content, path.name)
    else:
        header, raw = _binary(content, version, path.name)
    n_x, n_y = int(header["numpoints"]), int(header["numprofiles"])
    if raw.size != n_x * n_y:
        raise ValueError(f"{path.name} holds {raw.size} heights but announces {n_x} x {n_y}: is it complete?")
    if not (header["xscale"] > 0 and header["yscale"] > 0 and header["zscale"] != 0):
        raise ValueError(f"{path.name} has a scale of zero: a height map needs Xscale, Yscale and Zscale")
    missing = ~np.isfinite(raw)
    stored = TYPES.get(int(header["datatype"]))
    if stored is None:
        raise ValueError(f"{path.name} has DataType {header['datatype']:g}: the types 0 to 7 are known")
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


Header = dict[str, float]


def _text(content: bytes, name: str) -> tuple[Header, np.ndarray]:
    records = re.split(r"^\s*\*\s*$", content.decode("ascii", errors="replace"), flags=re.MULTILINE)
    if len(records) < 2:
        raise ValueError(f"{name} has no line with a star between header and heights: is it complete?")
    pairs = (line.split(";")[0].partition("=") for line in records[0].splitlines()[1:])
    entries = {key.strip().lower(): value.strip() for key, _, value in pairs}
    header: Header = {}
    for key in ("NumPoints", "NumProfiles", "Xscale", "Yscale", "Zscale", "DataType", "Compression"):
        try:
            header[key.lower()] = _finite(entries.get(key.lower(), ""))
        except ValueError:
            raise ValueError(f"{name} lacks a number for {key} in its header") from None
    if header["compression"]:
        raise ValueError(f"{name} is compressed: write it uncompressed")
    words = re.sub(r";.*", "", records[1]).upper().replace("BAD", "NAN").split()
    try:
        return header, np.array(words, dtype=float)
    except ValueError:
        raise ValueError(f"{name} has heights that are not numbers") from None


def _finite(word: str) -> float:
    number = float(word)
    if not np.isfinite(number):
        raise ValueError(f"{word} is no finite number")
    return number


def _binary(content: bytes, version: str, name: str) -> tuple[Header, np.ndarray]:
    count = "I" if version == "ISO-2.0" else "H"
    layout = struct.Struct(f"<8s10s12s12s{count}{count}4d3B")
    if len(content) < layout.size:
        raise ValueError(f"{name} ends within its header: is it complete?")
    n_x, n_y, x_scale, y_scale, z_scale, _, compression, kind, _ = layout.unpack_from(content)[4:]
    if compression or kind not in TYPES:
        raise ValueError(f"{name} is compressed or has the unknown DataType {kind}: write it plain, types 0 to 7")
    available = (len(content) - layout.size) // np.dtype(TYPES[kind]).itemsize
    raw = np.frombuffer(content, TYPES[kind], min(n_x * n_y, available), layout.size).astype(float)
    keys = ("numpoints", "numprofiles", "xscale", "yscale", "zscale", "datatype")
    return dict(zip(keys, (n_x, n_y, x_scale, y_scale, z_scale, kind), strict=True)), raw

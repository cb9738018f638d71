"""A text is read alike in any encoding, and with what it includes from the folders where programs look for it."""

from pathlib import Path

import numpy as np
import pytest

from tests.helpers.small_decks import archive, bricks, bulk, straight
from tribodyn.fem.load_vectors import temperature_at
from tribodyn.geometry import height_map_files
from tribodyn.geometry.sources import foreign_file
from tribodyn.reduction import matrix_files
from tribodyn.text_file import lines_of
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.measured import reading

SHAPE = (1, 1, 1), straight
DECKS = {"inp": bricks(*SHAPE), "bdf": bulk(*SHAPE) + "PSOLID,1,1\n", "cdb": archive(*SHAPE)}
ENCODINGS = ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"]
HEIGHTS = "".join(f"{x} {y} {x * y}\n" for x in range(4) for y in range(4))
MARKET = "%%MatrixMarket matrix coordinate real general\n2 2 1\n1 2 3.0\n"
READERS = {
    **{f"deck.{ending}": (text, lambda path: foreign_file.read(path).counts) for ending, text in DECKS.items()},
    "heights.csv": (HEIGHTS, lambda path: height_map_files.read(path).z.tolist()),
    "matrix.mtx": (MARKET, lambda path: matrix_files.read_matrix(path)[0].toarray().tolist()),
    "field.csv": ("x,y,z,T\n0,0,0,1\n1,0,0,2\n", lambda path: temperature_at(path, np.eye(3)).tolist()),
    "test.csv": ("frequency_Hz,acceleration [m/s2/N]\n1.0,2\n2.0,3\n", lambda path: repr(reading.read(path).runs)),
    "scene.toml": ('[scene]\ntitle = "Ü"\n', lambda path: scene_file.tables(path, "scene")),
}


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("name", READERS)
def test_every_reader_takes_every_encoding(name: str, encoding: str, tmp_path: Path) -> None:
    text, reader = READERS[name]
    outcomes = []
    for kind in ("utf-8", encoding):
        path = tmp_path / kind / name
        path.parent.mkdir()
        path.write_bytes(text.replace("\n", "\r\n").encode(kind) + b"\x1a" * (kind == "utf-8"))
        outcomes.append(reader(path))
    assert outcomes[0] == outcomes[1]


@pytest.mark.parametrize(("files", "expected"), [
    ({"main": "1\n<s/a\n2", "s/a": "3\n<s/b", "s/b": "4"}, "1342"),  # from the folder of the main file
    ({"main": "<s/a", "s/a": "<b", "s/b": "4"}, "4"),  # of the file that includes
    ({"main": "<s/a", "s/a": "<b", "s/b": "4", "b": "5"}, "5"),  # the main one first
    ({"main": "<s\\a", "s/a": "\x1b[31m"}, "\ufffd[31m"),
    ({"main": "<a", "a": "1"}, "1"),
    ({"main": "1\n2\n<a"}, "line 3 of 'main' includes the file 'a', which does not exist"),
    ({"main": "<a", "a": "\n<main"}, "line 2 of 'a' includes 'main', which includes itself"),
    ({"main": "<0\n", **{str(k): f"<{k + 1}\n" * 9 for k in range(9)}, "9": "1"}, "many times"),
    ({"main": "<a\n" * 30, "a": "x" * 7_000_000}, "MB with those before"),
])  # fmt: skip
def test_included_files(files: dict[str, str], expected: str, tmp_path: Path) -> None:
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(text.encode("utf-8" if text.isascii() else "cp1252"))

    def joined() -> str:
        lines = lines_of(tmp_path / "main", included_name=lambda line: line[1:] if line[:1] == "<" else "")
        return "".join(line.text for line in lines if line.text[:1] != "<")

    if " " in expected:
        with pytest.raises(ValueError, match=expected):
            joined()
    else:
        assert joined() == expected

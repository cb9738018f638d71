"""The text of files from elsewhere: its encoding, its lines with their places, and files that include others.

Every reader of a text takes it from here, so that a byte order mark, UTF-16 or an old code page matter to none of them.
"""

import codecs
import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, TextIO

from tribodyn.refusal import Refusal

MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32",
         codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}  # fmt: skip
CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x9f]")  # a terminal would obey these


def encoding_of(head: bytes) -> str:
    """Encoding by the first bytes of a file: its byte order mark, or the zeros of UTF-16 without one; else UTF-8."""
    for mark, name in MARKS.items():
        if head.startswith(mark):
            return name
    zeros = head[0::2].count(0), head[1::2].count(0)
    if max(zeros) > len(head) // 4:
        return "utf-16-be" if zeros[0] > zeros[1] else "utf-16-le"
    return "utf-8"


def text_of(path: Path) -> str:
    """Text of a file with line ends of one character, control characters replaced; no UTF is read as Windows-1252."""
    content = path.read_bytes()
    encoding = encoding_of(content[:4096])
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = content.decode("cp1252" if encoding == "utf-8" else encoding, errors="replace")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return CONTROL.sub("\ufffd", text.rstrip("\x1a"))  # the end of a file for DOS


def finite(word: str) -> float:
    """A word as a number, 0 where it is empty. Raises ValueError for infinity, "nan" and what is no number."""
    if not math.isfinite(number := float(word or 0)):
        raise ValueError(f"no finite number: '{word}'")
    return number


def numbers_of(words: Iterable[str]) -> list[float] | None:
    """Words as numbers, None where one of them is none."""
    try:
        return [finite(word or "none") for word in words]
    except ValueError:
        return None


def open_text(path: Path) -> TextIO:
    """A file opened as text, for those of which a part is enough."""
    with path.open("rb") as stream:
        encoding = encoding_of(stream.read(4096))
    return path.open(encoding=encoding, errors="replace")


class Line(NamedTuple):
    """A line of a file. number : from 1, of the first where it continues; where : its place, for sentences"""

    text: str
    file: Path
    number: int

    @property
    def where(self) -> str:
        """Its place in a sentence."""
        return f"line {self.number} of '{self.file.name}'"


def lines_of(
    path: Path,
    comment: str = "",
    continues: Callable[[str], bool] = lambda line: False,
    included_name: Callable[[str], str] = lambda line: "",
) -> Iterator[Line]:
    """The lines of a file; those of an included file follow the line that includes it.

    comment : what a line begins with that is passed over, as empty lines then are; "" to have all lines
    continues : whether a line goes on in the next; included_name : name of the file that a line includes, or ""
    Raises  Refusal: an included file that is not there, that includes itself, or more of them than any deck has"""
    return _Inclusions(path.resolve().parent, comment, continues, included_name).lines(path)


@dataclass
class _Inclusions:
    """Reads a file with all that it includes. folder : of the main file; sizes : of the files that were included"""

    folder: Path
    comment: str
    continues: Callable[[str], bool]
    included_name: Callable[[str], str]
    count: int = 0
    total: int = 0
    sizes: dict[Path, int] = field(default_factory=dict)

    def lines(self, path: Path, within: tuple[Path, ...] = ()) -> Iterator[Line]:
        """Lines of a file. within : files that include it"""
        within = (*within, path.resolve())
        line, pending = Line("", path, 0), ""
        for number, text in enumerate(text_of(path).split("\n"), 1):
            if self.comment and (not (stripped := text.strip()) or stripped.startswith(self.comment)):
                continue
            line = Line(text, path, number) if not pending else line._replace(text=pending + text.strip())
            pending = line.text.rstrip() if self.continues(line.text) else ""
            if pending:
                continue
            yield line
            if name := self.included_name(line.text):
                yield from self.lines(self._file(name, line, within), within)
        if pending:
            yield line

    def _file(self, name: str, line: Line, within: tuple[Path, ...]) -> Path:
        """The file that a line includes: from the folder of the main file, else of the file that includes it.

        Source  Abaqus and CalculiX count from the folder of the job"""
        names = name, name.replace("\\", "/")
        places = [folder / text for text in names for folder in (self.folder, line.file.parent)]
        path = next((place for place in places if place.is_file()), None)
        if path is None:
            raise Refusal(f"{line.where} includes the file '{name}', which does not exist: put it there")
        if path.resolve() in within:
            raise Refusal(f"{line.where} includes '{path.name}', which includes itself: take the line out")
        self.count += 1
        self.total += self.sizes.setdefault(path.resolve(), path.stat().st_size)
        if self.count > 1000 or self.total > 1e8 + 10 * sum(self.sizes.values()):
            raise Refusal(f"{line.where} includes '{path.name}' as number {self.count}, {self.total / 1e6:.0f} MB "
                          "with those before: the files include each other many times, take that out")  # fmt: skip
        return path

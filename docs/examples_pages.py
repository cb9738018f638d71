"""The gallery of examples: every script of docs/examples is run, its page has its picture, code and output.

A script is a docstring of a title and a text, and code that leaves pictures in the folder where it is run.
"""

from __future__ import annotations

import ast
import contextlib
import io
import os
import shutil
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
from PIL import Image

FOLDER = Path(__file__).parent / "examples"
WIDEST = 900  # pixels of a picture, of a thumbnail a third


def write(folder: Path) -> None:
    """Run every script and write its page, and the page of all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    cards = ["# Examples", "", "Each is a script that the build of this site has run.", "", "::::{container} cards"]
    names = []
    for script in sorted(FOLDER.glob("*.py")):
        name, source = script.stem, script.read_text(encoding="utf-8")
        title, _, text = (ast.get_docstring(ast.parse(source)) or name).partition("\n")
        seconds, printed, pictures = run(source, script.name, folder / name)
        code = source.partition('"""\n')[2].partition('"""\n')[2] or source.split('"""', 2)[2]
        page = [f"# {title}", "", text.strip(), ""]
        page += [line for picture in pictures for line in (f"![{title}]({name}/{picture})", "")]
        page += ["```{code-block} python", code.strip(), "```", ""]
        page += ["It prints:", "", "```text", printed.strip(), "```", ""] if printed.strip() else []
        nbformat.write(as_notebook(title, text.strip(), code.strip()), folder / f"{name}.ipynb")
        page += [
            f"{{download}}`Download this script <../{script.name}>`, or it "
            f"{{download}}`as a notebook <{name}.ipynb>`. It took {seconds:.0f} s to run.", "",
        ]  # fmt: skip
        (folder / f"{name}.md").write_text("\n".join(page), encoding="utf-8")
        cards += ["", ":::{container} card", f"[![{title}]({name}/thumbnail.png)]({name}.md)", ""]
        cards += [f"[{title}]({name}.md)", ":::"]
        names.append(name)
    cards += ["::::", "", "```{toctree}", ":hidden:", "", *names, "```", ""]
    (folder / "index.md").write_text("\n".join(cards), encoding="utf-8")


def as_notebook(title: str, text: str, code: str) -> Any:
    """The same text and code in two cells."""
    notebook = nbformat.v4
    return notebook.new_notebook(
        cells=[notebook.new_markdown_cell(f"# {title}\n\n{text}"), notebook.new_code_cell(code)]
    )


def run(source: str, name: str, out: Path) -> tuple[float, str, list[str]]:
    """Run a script in an empty folder: processor seconds, what it printed, its PNG pictures, which `out` has then."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    printed, start, back = io.StringIO(), time.process_time(), Path.cwd()
    with TemporaryDirectory() as place:
        os.chdir(place)
        try:
            with contextlib.redirect_stdout(printed):
                exec(compile(source, name, "exec"), {"__name__": "__main__"})
        finally:
            os.chdir(back)
        seconds = time.process_time() - start
        pictures = sorted(path for path in Path(place).glob("*.png"))
        if not pictures:
            raise ValueError(f"docs/examples/{name} leaves no picture")
        for path in pictures:
            with Image.open(path) as image:
                for target, width in ((path.name, WIDEST), ("thumbnail.png", WIDEST // 3)):
                    if target != "thumbnail.png" or path == pictures[0]:
                        small = image.convert("RGB")
                        small.thumbnail((width, 2 * width))
                        small.save(out / target)
    return seconds, printed.getvalue(), [path.name for path in pictures]

"""A result as a notebook shows it: its numbers, its response as a picture, its worn part to turn."""

from __future__ import annotations

from functools import partial
from html import escape

from tribodyn.workflows.pictures import plots
from tribodyn.workflows.report import page, text
from tribodyn.workflows.result.result import Result


def shown(result: Result) -> str:
    """HTML of a result; the part stands in a frame of its own, which needs nothing from the notebook."""
    parts = [f"<pre>{escape(chr(10).join(text.brief(result)))}</pre>"]
    figures = plots.figures(result)
    if "frf" in figures:
        parts.append(page.embedded("response", partial(figures["frf"], result), dpi=90))
    viewer = page.part_alone(result)
    if viewer:
        parts.append(f'<iframe width="100%" height="680" style="border:0" srcdoc="{escape(viewer)}"></iframe>')
    return "".join(parts)

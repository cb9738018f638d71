"""A result as a notebook shows it: its numbers, its response as a picture, its worn part to turn."""

from __future__ import annotations

import base64
import io
from html import escape

import matplotlib as mpl

from tribodyn.workflows.pictures import plots
from tribodyn.workflows.pictures.style import STYLE
from tribodyn.workflows.report import page, text
from tribodyn.workflows.result.result import Result


def shown(result: Result) -> str:
    """HTML of a result; the part stands in a frame of its own, which needs nothing from the notebook."""
    parts = [f"<pre>{escape(chr(10).join(text.brief(result)))}</pre>"]
    figures = plots.figures(result)
    if "frf" in figures:
        with mpl.rc_context(STYLE):
            buffer = io.BytesIO()
            figures["frf"](result).savefig(buffer, format="png", dpi=90)
        parts.append(f'<img alt="response" src="data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}">')
    viewer = page.part_alone(result)
    if viewer:
        parts.append(f'<iframe width="100%" height="680" style="border:0" srcdoc="{escape(viewer)}"></iframe>')
    return "".join(parts)

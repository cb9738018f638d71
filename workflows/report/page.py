"""The page of one or several results: one HTML file with everything in it, that opens from disk without a network."""

import base64
import hashlib
import io
import json
import re
from collections.abc import Callable, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.output_file import write_text
from tribodyn.refusal import Refusal
from tribodyn.version import __version__
from tribodyn.workflows.pictures import offscreen, plots, render
from tribodyn.workflows.pictures.matplotlib_names import Figure, mpl
from tribodyn.workflows.pictures.theme import STYLE
from tribodyn.workflows.report import text
from tribodyn.workflows.report.charts import charts, solid
from tribodyn.workflows.result import store
from tribodyn.workflows.result.answers import answers_of
from tribodyn.workflows.result.result import Result

HEADING = "part"  # the picture that heads the page
LARGEST = 15e6  # bytes of a page
FOLDER = Path(__file__).parent


def page(results: Sequence[tuple[str, Result, Path | None]]) -> str:
    """The HTML of results: name, result and its file, None where it has none.

    Raises  ValueError where plotly is missing"""
    named = [(name, result) for name, result, _ in results]
    data: dict[str, Any] = {"charts": charts(named), "solids": [solid(result) for _, result in named]}
    title = ", ".join(name for name, _ in named)
    parts = [_head(named)]
    if len(named) > 1:
        parts.append(_section("Side by side", _comparison(named), "compare"))
    for number, (name, result, path) in enumerate(results):
        prefix = f"{name}: " if len(named) > 1 else ""
        parts.append(_section(f"{prefix}summary", _summary(result), f"verdict-{number}"))
        if data["solids"][number] is not None:
            parts.append(_section(f"{prefix}worn part", _viewer(number), f"part-{number}"))
        if number == 0:
            holders = "".join(
                f'<figure><figcaption>{title}</figcaption><div class="chart" data-chart="{title}"></div></figure>'
                for title in map(escape, data["charts"])
            )
            parts.append(_section("Curves", '<div class="grid">' + holders + "</div>", "curves"))
        parts.append(_section(f"{prefix}method and assumptions", _method(result), f"method-{number}"))
        parts.append(_section(f"{prefix}inspection of the part and model", _inspection(result), f"inspection-{number}"))
        parts.append(_section(f"{prefix}measured changes", _changes(result), f"changes-{number}"))
        parts.append(_section(f"{prefix}figures", _figures(result), f"figures-{number}"))
        parts.append(
            _section(f"{prefix}scene", f"<pre>{escape(result.provenance['scene_text'])}</pre>", f"scene-{number}")
        )
        parts.append(_section(f"{prefix}provenance", _provenance(result, path), f"provenance-{number}"))
    return _html(title, "\n".join(parts), data)


def part_alone(result: Result) -> str:
    """A page of the worn part alone, empty where it has no faces to show or plotly is missing."""
    data = solid(result)
    if data is None:
        return ""
    try:
        return _html(result.provenance["scene_name"], _viewer(0), {"charts": {}, "solids": [data]})
    except Refusal:
        return ""


def _html(title: str, body: str, data: dict[str, Any]) -> str:
    script = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    plotly = str(package("plotly.offline").get_plotlyjs()).replace("</script", "<\\/script")
    return (FOLDER / "page.html").read_text(encoding="utf-8").format(
        title=escape(title), style=(FOLDER / "page.css").read_text(encoding="utf-8"), body=body,
        plotly=plotly, data=script, script=(FOLDER / "page.js").read_text(encoding="utf-8"),
    )  # fmt: skip


def write(results: Sequence[tuple[str, Result, Path | None]], path: Path) -> Path:
    """Write the page of results. Raises ValueError where it becomes too large to pass on."""
    html = page(results)
    size = len(html.encode())
    if size > LARGEST:
        raise Refusal(f"the report would have {size / 1e6:.0f} MB: report fewer results at once")
    return write_text(path, html)


def _section(title: str, body: str, name: str) -> str:
    heading = title[:1].upper() + title[1:]
    return f'<section id="{name}"><h2>{escape(heading)}</h2>\n{body}\n</section>'


def _head(named: Sequence[tuple[str, Result]]) -> str:
    """The title block: what was run, by which program, when, how it ended, and the parts in their vibration."""
    rows, pictures = [], []
    for name, result in named:
        record, seconds = result.provenance, result.summary()["seconds"]
        started = record.get("started", "")[:16].replace("T", " ")
        rows.append((name, record.get("versions", "").split(",")[0], started, f"{result.state}, {seconds:.0f} s"))
        pictures += [embedded(kind, make) for kind, make in _renders(result).items() if kind == HEADING]
    title = _title(named[0][1]) if len(named) == 1 else ", ".join(name for name, _ in named)
    table = _table(rows, ("scene", "program", "started", "state"))
    return f"<header><h1>{escape(title)}</h1>{table}{''.join(pictures)}</header>"


def _title(result: Result) -> str:
    match = re.search(r'^title\s*=\s*"([^"]+)"', result.provenance["scene_text"], re.MULTILINE)
    return match.group(1) if match else result.provenance["scene_name"]


def _table(rows: Sequence[Sequence[str]], head: Sequence[str] = ()) -> str:
    """A table; on a narrow page the rows of one with a head are stacked, each cell behind the name of its column."""
    top = f"<thead><tr>{''.join(f'<th>{escape(h)}</th>' for h in head)}</tr></thead>" if head else ""
    lines = []
    for row in rows:
        names = [f' data-head="{escape(name)}"' if name else "" for name in head] or [""] * len(row)
        cells = (f"<td{name}>{escape(cell)}</td>" for name, cell in zip(names, row, strict=True))
        lines.append(f"<tr>{''.join(cells)}</tr>")
    kind = ' class="wide"' if head else ""
    return f'<div class="scroll"><table{kind}>{top}<tbody>{"".join(lines)}</tbody></table></div>'


def _summary(result: Result) -> str:
    """What `show` prints, and every number below it to unfold."""
    mark = "good" if result.finished else "bad"
    html = f'<pre class="{mark}">{escape(chr(10).join(text.brief(result)))}</pre>'
    return f"{html}<details><summary>every number</summary>{_table(text.lines(result))}</details>"


def _method(result: Result) -> str:
    """One paragraph on how the numbers came about and what they take for granted."""
    scene, facts = result.scene, result.facts
    laws = ", ".join(sorted({contact.law for contact in scene.joints.values()}))
    wear = None if scene.wear is None else scene.wear.law
    sentences = [
        f"The structure is linear: {facts.full_dofs} degrees of freedom with small displacements and linear elasticity"
        + (f", reduced to {facts.model_dofs}" if facts.model_dofs != facts.full_dofs else "") + ".",
        f"Its contact has {facts.contact_pairs} pairs of the law {laws}. The motion is a sum of the harmonics "
        f"{', '.join(map(str, result.harmonics))}, balanced with the contact forces over one cycle.",
        f"Wear follows the law {wear}, in steps of many cycles." if wear and result.wear_steps else "",
        "Friction, stiffness and wear coefficient are inputs: no error includes their scatter.",
    ]  # fmt: skip
    return f"<p>{escape(' '.join(filter(None, sentences)))}</p>"


def _number(value: Any) -> str:
    return "none" if value is None else f"{value:.5g}" if isinstance(value, int | float) else str(value)


def _comparison(named: Sequence[tuple[str, Result]]) -> str:
    """Numbers of all results, with the relative difference from the first."""
    tables = [_headlines(result) for _, result in named]
    rows = []
    for label in dict.fromkeys(label for table in tables for label in table):
        first: Any
        first, *values = (table.get(label) for table in tables)
        cells = [_number(first)]
        for value in values:
            comparable = value is not None and first not in (None, 0)
            cells.append(_number(value) + (f" ({value / first - 1:+.2%})" if comparable else ""))
        rows.append((label, *cells))
    return _table(rows, ("", *(name for name, _ in named)))


def _headlines(result: Result) -> dict[str, Any]:
    """Label with unit -> number, of what results are compared by."""
    answers = [answer for answer in answers_of(result) if answer.quantity.headline and not answer.joint]
    table: dict[str, Any] = {}
    for answer in answers:
        unit, moment = answer.quantity.unit, answer.moment
        if answer.value is not None:
            table[f"{answer.quantity.title}{unit and f' / {unit}'}{moment and f', {moment}'}"] = answer.value
    facts = result.facts
    sizes = {"contact pairs": facts.contact_pairs, "DOFs of the model": facts.model_dofs, "seconds": facts.seconds}
    return table | sizes


def _inspection(result: Result) -> str:
    names = {
        "elements": "elements", "nodes": "nodes", "scaled_jacobian": "smallest scaled Jacobian (1 is best)",
        "full_dofs": "DOFs of the full model", "model_dofs": "DOFs of the reduced model",
        "retained_modes": "retained modes",
        "first_omitted_frequency": "first omitted mode / Hz", "open_frequencies": "modes, contact open / Hz",
        "stuck_frequencies": "modes, contact stuck / Hz", "contact_pairs": "contact pairs",
        "unknowns": "unknowns of the balance", "harmonics": "harmonics", "compliance_error": "error of the compliance",
        "factorisation": "factorisation", "prestress_residual": "residual of the prestress",
        "prestress_rotation": "largest static rotation / rad", "sectors": "sectors", "engine_order": "engine order",
    }  # fmt: skip
    rows, table = [], result.facts.table()
    for key, label in names.items():
        value = table.get(key)
        if value is not None:
            is_array = getattr(value, "ndim", 0) > 0
            if is_array and not len(value):
                continue
            shown = ", ".join(_number(v) for v in np.asarray(value).tolist()[:6]) if is_array else _number(value)
            rows.append((label, shown))
    rows.append(("area of the contact / mm²", f"{1e6 * result.patch.area.sum():.5g}"))
    return _table(rows)


def _changes(result: Result) -> str:
    entries = result.summary()["changes"] or []
    if not entries:
        return "<p>No refinement has been measured.</p>"
    rows = [
        (
            e["refinement"],
            e["quantity"],
            "not known" if e["relative"] is None else text.percent(e["relative"]),
            e["description"],
        )
        for e in entries
    ]
    return _table(rows, ("refinement", "quantity", "relative change", "description"))


def _figures(result: Result) -> str:
    """Every figure as an embedded picture; renders only where this machine can draw them."""
    elements = [embedded(name, partial(make, result)) for name, make in plots.figures(result).items()]
    elements += [embedded(name, make) for name, make in _renders(result).items() if name != HEADING]
    return '<div class="grid">' + "".join(elements) + "</div>"


def embedded(name: str, make: Callable[[], Figure], dpi: int = 110) -> str:
    """A figure as an element of a page."""
    with mpl.rc_context(STYLE):
        buffer = io.BytesIO()
        make().savefig(buffer, format="png", dpi=dpi)
    code = base64.b64encode(buffer.getvalue()).decode()
    return f'<figure><img alt="{escape(name)}" src="data:image/png;base64,{code}"></figure>'


def _renders(result: Result) -> dict[str, Callable[[], Figure]]:
    renders = render.figures(result)
    if not renders:
        return {}
    try:
        offscreen.check()
    except offscreen.RenderingUnavailable:
        return {}
    return renders


def _viewer(number: int) -> str:
    return (
        f'<div class="viewer" data-solid="{number}"><div class="solid"></div><div class="controls">'
        '<label>state <input type="range" class="state" min="0" value="0" step="1"></label>'
        '<output class="label"></output>'
        '<label>colour <select class="field"></select></label>'
        '<label class="opener"><input type="checkbox" class="open"> bodies apart</label></div>'
        '<div class="legend"></div></div>'
    )


def _provenance(result: Result, path: Path | None) -> str:
    record = result.provenance
    changes = "".join(f" --set {json.dumps(text)}" for text in record.get("overrides", "").split("\n") if text)
    rows = [("command", f"tribodyn run {record['scene_name']}{changes}")]
    rows.append(("SHA-256 of the scene", hashlib.sha256(record["scene_text"].encode()).hexdigest()))
    if path is not None:
        rows.append((f"SHA-256 of {path.name}", hashlib.sha256(path.read_bytes()).hexdigest()))
    rows += [(f"SHA-256 of {name} begins with", digest) for name, digest in store.file_digests(result).items()]
    rows += [
        (key, record[key]) for key in ("versions", "python", "platform", "seed", "threads", "started") if key in record
    ]
    rows.append(("report by", f"tribodyn {__version__}"))
    return _table(rows)


def shown(result: Result) -> str:
    """HTML of a result; the part stands in a frame of its own, which needs nothing from the notebook."""
    parts = [f"<pre>{escape(chr(10).join(text.brief(result)))}</pre>"]
    figures = plots.figures(result)
    if "frf" in figures:
        parts.append(embedded("response", partial(figures["frf"], result), dpi=90))
    viewer = part_alone(result)
    if viewer:
        parts.append(f'<iframe width="100%" height="680" style="border:0" srcdoc="{escape(viewer)}"></iframe>')
    return "".join(parts)

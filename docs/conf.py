"""Settings of the documentation: `./tribodyn docs` builds it, warnings are errors."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER))
os.environ["PYTHONPATH"] = os.pathsep.join([str(FOLDER.parent / "src"), *filter(None, [os.environ.get("PYTHONPATH")])])
os.environ["PYTHONWARNINGS"] = "ignore:IProgress not found"  # it names a path of this machine
sys.path[:0] = [str(FOLDER.parent / "src"), str(FOLDER.parent)]  # the program, and the proofs with their bench

import docstrings  # noqa: E402
import examples_pages  # noqa: E402
import generated_pages  # noqa: E402
import outputs  # noqa: E402
from pygments.lexers.special import TextLexer  # noqa: E402
from sphinx.application import Sphinx  # noqa: E402
from sphinx.highlighting import lexers  # noqa: E402

logging.getLogger("skfem").setLevel(logging.WARNING)  # what it says of its work is nothing for the build's log

project = "tribodyn"
author = "The authors of tribodyn"
project_copyright = author
version = release = generated_pages.version()

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.viewcode", "sphinx-mathjax-offline"]
exclude_patterns = ["_build", "generated", "examples/generated/*.ipynb", "**/results"]
html_extra_path = ["generated/scene.schema.json"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence", "attrs_inline"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
highlight_language = "none"
lexers["geo"] = TextLexer()  # scripts of Gmsh

# Pages with {code-cell} are executed in every build; a cell that fails ends the build.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_execution_in_temp = True
nb_merge_streams = True
nb_execution_show_tb = True

html_theme = "furo"
html_title = "tribodyn"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["copy.js"]
html_show_sphinx = False
html_copy_source = False


def setup(app: Sphinx) -> None:
    """Make the generated pages before anything is read; docstrings are read in the form that this project has."""
    for name in ("skfem", "traitlets"):  # they tell every step of what the pages run
        logging.getLogger(name).setLevel(logging.WARNING)
    generated_pages.write(FOLDER / "generated")
    examples_pages.write(FOLDER / "examples" / "generated")
    app.connect("source-read", outputs.add)
    app.connect("autodoc-process-docstring", docstrings.process)

"""Settings of the manual: `make docs` writes it to out/docs, without the network."""

from __future__ import annotations

import os
from importlib.metadata import version as installed
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

# Nothing is drawn or compiled while docstrings are read.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("MACS_COMPILE", "0")

project = "MACS"
author = "the MACS team"
release = version = installed("macs-trajectories")
extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
root_doc = "index"
templates_path = ["_templates"]
exclude_patterns = ["_templates"]

myst_enable_extensions = ["deflist", "dollarmath", "html_image"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the Parameters sections have them, in words
default_role = "py:obj"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "furo"
html_title = f"MACS {release}"
html_show_sourcelink = False
html_copy_source = False
html_show_copyright = False
html_math_renderer = "mathml"


def inline_math(writer: Any, node: nodes.math) -> None:
    """Write a formula in the text as MathML, which browsers draw without a script."""
    writer.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def displayed_math(writer: Any, node: nodes.math_block) -> None:
    """Write a formula on lines of its own."""
    writer.body.append(f"<p>{tex2mathml(node.astext(), as_block=True)}</p>")
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Register the renderer of formulas."""
    app.add_html_math_renderer("mathml", (inline_math, None), (displayed_math, None))

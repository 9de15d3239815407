"""Sphinx configuration: MyST pages, docstrings with maths, the command line's own help; nothing is fetched."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

from skillframe import __version__

project = "skillframe"
author = "the skillframe authors"
copyright = "the skillframe authors, Apache-2.0"
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "docstring_maths",
    "command_help",
    "gallery",
    "generated",
]
exclude_patterns = ["_build", "_extensions", "_static"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
default_role = "code"
highlight_language = "text"  # unmarked blocks are what one types, not Python

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "show-inheritance": False}
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_attr_annotations = False  # the docstring gives shapes and units, which say more

html_theme = "furo"
html_title = f"skillframe {version}"
html_static_path = ["_static"]
html_css_files = ["own.css"]
html_copy_source = False
html_show_sourcelink = False

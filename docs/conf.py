"""The documentation site: `python -m sphinx -W --keep-going -b html docs docs/_build/html`. Needs no network."""

from __future__ import annotations

import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).resolve().parent))

from circlepose import __version__
from sitegen import build, links

project = "circlepose"
author = "The circlepose developers"
copyright = author
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
# `%YAML:1.0`, with which OpenCV to 4.x begins, is no YAML.
suppress_warnings = ["misc.highlighting_failure"]
exclude_patterns = ["_build", "sitegen", "notebooks", "pictures"]
myst_heading_anchors = 4
# In docstrings, `name` is code.
default_role = "literal"
highlight_language = "text"
# Else -- of an option becomes a dash.
smartquotes = False

autodoc_typehints = "signature"
autodoc_class_signature = "mixed"
autodoc_preserve_defaults = True
# Named as the code names them; they are arrays of NumPy.
autodoc_type_aliases = {name: name for name in ("BoolArray", "FloatArray", "Image", "IntArray")}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"circlepose {release}"
html_theme_options = {"source_repository": links.REPOSITORY, "source_branch": "main", "source_directory": "docs/"}
html_show_copyright = False
html_show_sphinx = False


def _with_links_of_the_site(_: Sphinx, name: str, source: list[str]) -> None:
    if not name.startswith("generated/"):
        source[0] = links.for_site(source[0], f"docs/{name}.md")


def setup(app: Sphinx) -> None:
    """Make the generated pages; the language of diagrams is shown as text."""
    app.add_lexer("mermaid", TextLexer)
    app.connect("builder-inited", lambda _: build.write_all())
    app.connect("source-read", _with_links_of_the_site)

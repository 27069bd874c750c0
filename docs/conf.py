"""Sphinx configuration; `python -m docs.generate` prepares the pages and runs it."""

project = "Cuecast"
author = "The Cuecast maintainers"
copyright = "Apache-2.0; data assets as REUSE.toml says"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = "Cuecast"
html_show_sourcelink = False
exclude_patterns = ["generate", "records"]

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

suppress_warnings = [
    "misc.highlighting_failure",  # forges draw Mermaid's diagrams; Pygments has no lexer for them
    "ref.python",  # attributes of one name in two classes, which napoleon links by name alone
]

"""Sphinx configuration; `python -m docs.generate` prepares the pages and runs it."""

project = "Cuecast"
author = "The Cuecast maintainers"
copyright = "Apache-2.0; data assets as REUSE.toml says"

extensions = ["myst_parser", "sphinx_copybutton"]
html_theme = "furo"
html_title = "Cuecast"
html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["wrap.css"]

copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4

suppress_warnings = [
    "misc.highlighting_failure"  # forges draw Mermaid's diagrams; Pygments has no lexer for them
]

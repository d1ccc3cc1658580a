"""The documentation: built by docs/build.sh, which puts this folder and the generated pages together first."""

import os
import sys
from pathlib import Path

from pygments.lexers.rust import RustLexer
from sphinx.highlighting import lexers

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
sys.path.insert(0, str(HERE / "gallery"))

# Examples that are compiled by `cargo test` and not run say so behind the name of their language.
lexers["rust,no_run"] = RustLexer()

project = "moiregauge"
author = "the moiregauge authors"
project_copyright = "the moiregauge authors"
version = release = os.environ.get("MOIREGAUGE_VERSION", "")

extensions = ["myst_parser", "sphinx_gallery.gen_gallery", "mathml"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["gallery", "coverage"]
nitpicky = True
# Two hyphens are the beginning of an option, not a dash.
smartquotes = False

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 4
# Headings of generated pages begin where their tables do.
suppress_warnings = ["myst.header", "config.cache"]

html_theme = "furo"
html_title = f"moiregauge {version}".strip()
html_static_path = ["_static"]
html_css_files = ["moiregauge.css"]
html_math_renderer = "mathml"
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {"navigation_with_keys": True}
highlight_language = "console"

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "examples",
    "filename_pattern": r"plot_.*\.py$",
    "ignore_pattern": r"(mg|readme_picture)\.py$",
    "remove_config_comments": True,
    "reset_modules": (),
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": False,
    "min_reported_time": 1000,
    "abort_on_example_error": True,
    "within_subsection_order": "FileNameSortKey",
    "thumbnail_size": (320, 240),
}

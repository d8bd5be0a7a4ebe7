"""The docs site: Sphinx with furo, built from the repository's root by `make docs`.

Sphinx, because it draws the API page from the docstrings, refuses links and names that
lead nowhere (-W), and makes pages with a search that work offline, from a folder.
"""

import inspect
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_site"))

import vdsm_pin

os.environ.setdefault("COLUMNS", "88")

project = "vdsm-pin"
author = "the vdsm-pin authors"
project_copyright = author
version = release = vdsm_pin.__version__

root_doc = "docs/index"
source_suffix = {".md": "markdown"}
include_patterns = [
    *("docs/*.md", "docs/**/*.md"),
    *("reports/*.md", "reports/**/*.md"),
    "benchmarks/hrm*/README.md",
    "examples/README.md",
    *("ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"),
]
exclude_patterns = ["**/.venv", "**/node_modules"]
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "command_pages",
]
myst_enable_extensions = ["deflist", "colon_fence", "html_image"]
myst_heading_anchors = 4
napoleon_custom_sections = [("Attributes", "params_style")]
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True

nitpick_ignore_regex = [
    ("py:.*", r"(numpy|typing|pathlib|collections|vdsm_pin)\..*|[A-Z]\w*|tuple\[.*")
]
"""Names of types that have no page here, and what is left of one cut at a comma."""

html_theme = "furo"
html_title = f"vdsm-pin {release}"
html_static_path = ["_site"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False

inspect.signature(vdsm_pin.plan)  # names are imported when first used: now

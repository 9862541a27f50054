"""The site: `sphinx-build -W docs OUT` with the extra docs, without a network.

Each build writes the reference (reference/), draws the gallery (figures/) and the pictures of the
explanation; git ignores them.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import TYPE_CHECKING

from numpydoc.xref import DEFAULT_LINKS

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE / "gallery")]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import reference  # noqa: E402 - the lines above say where it is

project = "tactstrip"
author = "The tactstrip developers"
release = version = version_of("tactstrip")
html_title = f"tactstrip {version}"

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "reference",
    "stacked",
]
exclude_patterns = ["_ext", "gallery", "examples"]
suppress_warnings = ["config.cache"]  # the gallery's scraper is an object; it is never cached
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # docstrings name types and modules, listed here or not
default_role = "py:obj"

myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "dollarmath", "tasklist"]
html_math_renderer = "mathml"

autodoc_typehints = "none"  # the docstrings say it, with units
numpydoc_show_class_members = False
numpydoc_xref_param_type = True
# a type with a page is a link to it; those of other projects are none, without a network
numpydoc_xref_aliases = {word: word for word in DEFAULT_LINKS} | reference.aliases()
numpydoc_xref_ignore = "all"

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "figures",
    "filename_pattern": r"/(figure|section|psychometric|example)_",
    "within_subsection_order": "FileNameSortKey",
    "ignore_pattern": r"(paper_plate|front_page)\.py",
    "image_scrapers": ("drawn.scraper",),
    "reset_argv": "drawn.arguments",
    "copyfile_regex": r"paper_plate\.py",
    "download_all_examples": False,
    "notebook_extensions": set(),
    "show_signature": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "abort_on_example_error": True,
}

html_theme = "pydata_sphinx_theme"
templates_path = ["_templates"]
html_sidebars = {"**": ["contents.html"]}
html_static_path = ["_static"]
html_css_files = ["tactstrip.css"]
html_js_files = [("quiet.js", {"priority": 100})]
html_context = {"default_mode": "auto"}
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "show_prev_next": True,
    "navbar_center": [],
    "navigation_with_keys": False,
    "navbar_end": ["theme-switcher"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
project_copyright = "The tactstrip developers, BSD-3-Clause licence"


def draw_explanation(_app: Sphinx, _config: object) -> None:
    """Draw the picture of each script in explanation/ that is newer than its picture."""
    for script in (HERE / "explanation").glob("*.py"):
        picture = script.with_suffix(".png")
        if not picture.exists() or picture.stat().st_mtime < script.stat().st_mtime:
            command = [sys.executable, str(script), str(picture)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def setup(app: Sphinx) -> None:
    """Draw the pictures before Sphinx looks for them."""
    app.connect("config-inited", draw_explanation)

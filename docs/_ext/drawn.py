"""Shows in the gallery the pictures that its scripts draw to the file in their command line."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst


def arguments(_conf: dict[str, Any], script: dict[str, Any]) -> list[str]:
    """Return the command line of a script: the file to draw to, in the gallery's own folder."""
    return [str(_drawn_by(script))]


def scraper(_block: tuple[Any, ...], script: dict[str, Any], conf: dict[str, Any]) -> str:
    """Take the picture that a script has drawn since the last call."""
    drawn = _drawn_by(script)
    if not drawn.exists():
        return ""
    image = next(script["image_path_iterator"])
    shutil.move(drawn, image)
    return str(figure_rst([image], conf["src_dir"]))


def _drawn_by(script: dict[str, Any]) -> Path:
    return Path(script["target_file"]).with_suffix(".drawn.png")

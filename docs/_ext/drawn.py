"""Shows in the gallery what its scripts draw to the file that their command line names."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sphinx_gallery.scrapers import figure_rst

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def arguments(_conf: dict[str, Any], script: dict[str, Any]) -> list[str]:
    """Return the command line of a script: the file to draw to, in the gallery's own folder."""
    return [str(_drawn_by(script))]


def scraper(_block: tuple[Any, ...], script: dict[str, Any], conf: dict[str, Any]) -> str:
    """Take up what a script has drawn since it was asked last."""
    drawn = _drawn_by(script)
    if not drawn.exists():
        return ""
    image = next(script["image_path_iterator"])
    shutil.move(drawn, image)
    return str(figure_rst([image], conf["src_dir"]))


def _drawn_by(script: dict[str, Any]) -> Path:
    return Path(script["target_file"]).with_suffix(".drawn.png")


def setup(_app: Sphinx) -> dict[str, bool]:
    """Let Sphinx import this module as an extension."""
    return {"parallel_read_safe": True, "parallel_write_safe": True}

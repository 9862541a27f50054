"""Shows in the gallery what its scripts draw to the file that their command line names.

It also offers each script together with the module that all of them import.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from zipfile import ZipFile

from sphinx_gallery.scrapers import figure_rst

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SHARED: Final = "paper_plate.py"
_OFFER: Final = f"""
    .. container:: sphx-glr-download sphx-glr-download-python

      :download:`Download what all figures share: {SHARED} <{SHARED}>`
"""


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


def zip_with_shared(folder: Path) -> None:
    """Put into the zip of each script what the script imports."""
    shared = folder / SHARED
    for path in folder.glob("*.zip"):
        with ZipFile(path, "w") as archive:
            for file in (path.with_suffix(".py"), shared):
                archive.write(file, file.name)


def _offer_shared(_app: Sphinx, _name: str, source: list[str]) -> None:
    if "sphx-glr-footer-example" in source[0]:
        source[0] += _OFFER


def setup(app: Sphinx) -> dict[str, bool]:
    """Complete the downloads, after the gallery made them."""
    app.connect(
        "builder-inited", lambda app: zip_with_shared(Path(app.srcdir, "figures")), priority=900
    )
    app.connect("source-read", _offer_shared)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

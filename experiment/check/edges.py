"""The other ideal edge of a plate whose cut-off nobody measured: the real one lies between both."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from experiment.study.plate import EdgeBasis
    from experiment.study.study import Study


_OTHER: Final[dict[str, EdgeBasis]] = {
    "clamped": "simply-supported",
    "simply-supported": "clamped",
}


def other_edge(study: Study) -> EdgeBasis | None:
    """Return the ideal edge that a study does not state.

    None for elastic edges and where a cut-off was measured: then it is known how they hold.

    >>> from experiment.study.files import paper_study, study_from_text
    >>> other_edge(study_from_text("strip = { edge = 'clamped' }", "study.toml"))
    'simply-supported'
    >>> other_edge(paper_study())
    """
    known = study.plate.measured_cutoff_hz is not None
    return None if known else _OTHER.get(study.plate.edge)


def with_other_edge(study: Study) -> Study | None:
    """Return the study with its other ideal edge; None where there is none."""
    edge = other_edge(study)
    return None if edge is None else study.changed(strip=replace(study.plate, edge=edge))


def edge_words(edge: str) -> str:
    """Name an edge as it is read.

    >>> edge_words("simply-supported"), edge_words("measured-cutoff")
    ('simply supported', 'measured cut-off')
    """
    return edge.replace("-", " ").replace("cutoff", "cut-off")

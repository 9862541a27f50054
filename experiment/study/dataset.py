"""The sections [study], [participants] and [dataset]: what a study says of itself and its data."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Final

from experiment.study.base import Line, Name, Section, is_distinct, obeying

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.study.base import Rule

_COLUMN: Final = re.compile(r"(?!participant_id\Z)[a-z][a-z0-9_]{0,63}")
_COLUMN_RULE: Final = "must be 1 to 64 of a-z 0-9 _, a letter first, and not participant_id"
_Column = Annotated[str, obeying(lambda text: bool(_COLUMN.fullmatch(text)), _COLUMN_RULE)]
_Lines = Annotated[tuple[Line, ...], obeying(is_distinct, "must be distinct")]


class About(Section):
    """The name of the study, and the consent of its participants."""

    name: Name = "study"
    """name of the study, part of file names"""
    consent_version: Line | None = None
    """version of the consent form"""


class ParticipantColumn(Section):
    """A column of participants.tsv: its heading, its meaning, and its levels if it has some.

    Examples
    --------
    >>> glasses = ParticipantColumn(name="glasses", description="wears any", levels=("yes", "no"))
    >>> glasses.levels
    ('yes', 'no')
    """

    name: _Column
    """heading of the column"""
    description: Line
    """meaning of the column"""
    levels: _Lines = ()
    """the only values that are allowed, if any"""


class Participants(Section):
    """Columns of participants.tsv. Declare nothing by which a person can be recognised."""

    columns: tuple[ParticipantColumn, ...] = ()
    """name, description and, if only some values are allowed, levels of each column"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rule that headings are distinct."""
        names = [column.name for column in self.columns]
        yield not is_distinct(names), "columns", "must have distinct names", names


class Dataset(Section):
    """What an exported data set (BIDS) says about itself."""

    name: Line | None = None
    """title"""
    authors: _Lines = ()
    """authors, in the order of a citation"""
    license: Line | None = None
    """license, such as CC-BY-4.0"""
    acknowledgements: Line | None = None
    """acknowledgements"""
    how_to_acknowledge: Line | None = None
    """how to cite it"""
    funding: _Lines = ()
    """sources of funding, with grant numbers"""
    ethics_approvals: _Lines = ()
    """committees and numbers of approval"""
    references_and_links: _Lines = ()
    """papers and pages about it"""
    institution_name: Line | None = None
    """where it was recorded"""
    institution_address: Line | None = None
    """address of the institution"""
    task_description: Line | None = None
    """what participants did"""

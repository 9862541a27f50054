"""The sections [study], [participants] and [dataset]: what a study says of itself and its data."""

from __future__ import annotations

import re
from dataclasses import asdict

from pydantic import Field

from experiment.names import NAME, NAME_RULE, is_line
from experiment.study.base import FromTable, section

_COLUMN = re.compile(r"[a-z][a-z0-9_]{0,63}")
_IDENTIFIER = "participant_id"


@section
class About:
    """What the study is called, and what its participants agree to."""

    name: str = Field(default="paper", description="1 to 32 of A-Z a-z 0-9 _ -")
    consent_version: str | None = Field(
        default=None, description="of the form that participants sign"
    )

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise ValueError(f"name must be {NAME_RULE}; got {self.name!r}")
        if self.consent_version is not None and not is_line(self.consent_version):
            raise ValueError(
                f"consent_version must be a name in one line of text; got {self.consent_version!r}"
            )


@section
class ParticipantColumn:
    """A column of participants.tsv: its heading, what it says, and its words if any will not do.

    Examples
    --------
    >>> hand = ParticipantColumn(name="hand", description="preferred", levels=("left", "right"))
    >>> hand.levels
    ('left', 'right')
    """

    name: str
    description: str
    levels: tuple[str, ...] = Field(default=(), strict=False)

    def __post_init__(self) -> None:
        if not _COLUMN.fullmatch(self.name) or self.name == _IDENTIFIER:
            raise ValueError(
                f"name must be 1 to 64 of a-z 0-9 _ with a letter first, and not {_IDENTIFIER}; "
                f"got {self.name!r}"
            )
        if not is_line(self.description):
            raise ValueError(f"description must be one line of text; got {self.description!r}")
        _check_lines("levels", self.levels)


@section
class Participants:
    """What participants.tsv has beside the identifier.

    For example columns = [{ name = "handedness", description = "by questionnaire",
    levels = ["left", "right", "both"] }]. Declare nothing by which a person can be recognised.
    """

    columns: tuple[FromTable[ParticipantColumn], ...] = Field(
        default=(), strict=False, description="name, description and, if only some will do, levels"
    )

    def __post_init__(self) -> None:
        names = [column.name for column in self.columns]
        if len(set(names)) != len(names):
            raise ValueError(f"columns must have distinct names; got {names}")


@section
class Dataset:
    """What an exported data set (BIDS) says of itself; what is not given is left out of it."""

    name: str | None = Field(default=None, description="title")
    authors: tuple[str, ...] = Field(
        default=(), strict=False, description="in the order of a citation"
    )
    license: str | None = Field(default=None, description="such as CC-BY-4.0")
    acknowledgements: str | None = Field(default=None, description="who helped")
    how_to_acknowledge: str | None = Field(default=None, description="how it is to be cited")
    funding: tuple[str, ...] = Field(
        default=(), strict=False, description="sources, with numbers of grants"
    )
    ethics_approvals: tuple[str, ...] = Field(
        default=(), strict=False, description="committee and number"
    )
    references_and_links: tuple[str, ...] = Field(
        default=(), strict=False, description="papers and pages about it"
    )
    institution_name: str | None = Field(default=None, description="where it was recorded")
    institution_address: str | None = Field(default=None, description="and its address")
    task_description: str | None = Field(default=None, description="what participants did")

    def __post_init__(self) -> None:
        for key, value in asdict(self).items():
            if isinstance(value, tuple):
                _check_lines(key, value)
            elif value is not None and not is_line(value):
                raise ValueError(f"{key} must be one line of text; got {value!r}")


def _check_lines(name: str, lines: tuple[str, ...]) -> None:
    for place, line in enumerate(lines):
        if not is_line(line):
            raise ValueError(f"{name}[{place}] must be one line of text; got {line!r}")
    if len(set(lines)) != len(lines):
        raise ValueError(f"{name} must be distinct; got {list(lines)}")

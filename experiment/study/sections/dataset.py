"""What a study declares of its data set: columns about the participants, and its description."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields

from experiment.terms.checks import is_line

_COLUMN = re.compile(r"[a-z][a-z0-9_]{0,63}")
_IDENTIFIER = "participant_id"


@dataclass(frozen=True, slots=True, kw_only=True)
class ParticipantColumn:
    """A column of participants.tsv beside the identifier.

    Attributes
    ----------
    name : str
        Its heading: 1 to 64 of a-z, 0-9 and ``_``, a letter first.
    description : str
        What it says, for its sidecar.
    levels : tuple of str
        The words that it may hold; empty where any text or number is legal.

    Raises
    ------
    ValueError
        If the name is no heading, the description is empty, or a word stands twice.

    Examples
    --------
    >>> ParticipantColumn(name="Age", description="in years")
    Traceback (most recent call last):
    ValueError: name must be 1 to 64 of a-z 0-9 _ with a letter first, and not participant_id;
    got 'Age'
    """

    name: str
    description: str
    levels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not _COLUMN.fullmatch(self.name) or self.name == _IDENTIFIER:
            raise ValueError(
                f"name must be 1 to 64 of a-z 0-9 _ with a letter first, and not {_IDENTIFIER}; "
                f"got {self.name!r}"
            )
        if not is_line(self.description):
            raise ValueError(f"description must be one line of text; got {self.description!r}")
        _check_lines("levels", self.levels)


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """What a published data set says of itself; what is not known is left out of it.

    Attributes
    ----------
    name : str or None
        Title of the data set.
    authors : tuple of str
        Who made it.
    license : str or None
        Under which licence it is published.
    acknowledgements, how_to_acknowledge : str or None
        Whom it thanks, and how it is to be cited.
    funding, ethics_approvals, references_and_links : tuple of str
        Grants; approvals with their numbers; papers and addresses.
    institution_name, institution_address : str or None
        Where it was recorded.
    task_description : str or None
        What the participants did.

    Raises
    ------
    ValueError
        If a value is empty, or has more than one line; it begins with the name.
    """

    name: str | None = None
    authors: tuple[str, ...] = ()
    license: str | None = None
    acknowledgements: str | None = None
    how_to_acknowledge: str | None = None
    funding: tuple[str, ...] = ()
    ethics_approvals: tuple[str, ...] = ()
    references_and_links: tuple[str, ...] = ()
    institution_name: str | None = None
    institution_address: str | None = None
    task_description: str | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value: str | tuple[str, ...] | None = getattr(self, field.name)
            if isinstance(value, tuple):
                _check_lines(field.name, value)
            elif value is not None and not is_line(value):
                raise ValueError(f"{field.name} must be one line of text; got {value!r}")


def _check_lines(name: str, lines: tuple[str, ...]) -> None:
    for place, line in enumerate(lines):
        if not is_line(line):
            raise ValueError(f"{name}[{place}] must be one line of text; got {line!r}")
    if len(set(lines)) != len(lines):
        raise ValueError(f"{name} must be distinct; got {list(lines)}")

"""The commented study file that `tactstrip init` writes: a preset, worded by its sections."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path
from types import UnionType
from typing import Any, Final, Literal, Union, get_args, get_origin

import click

from experiment.terms.checks import require_word
from experiment.terms.exits import CommandError, refusals

_OVERRIDES: Final[dict[str, dict[str, Any]]] = {
    "paper": {},
    "recommended": {
        "study": {"name": "recommended"},
        "burst": {"window": "hann"},
        "design": {
            "blank_trials": 60,
            "practice_trials": 10,
            "order": "balanced",
            "responses": ["left", "right", "both", "none"],
            "break_every": 43,
        },
    },
}
PRESETS: Final = tuple(_OVERRIDES)
_INTRODUCTIONS: Final = {
    "paper": (
        "The protocol of A. Ben Dhiab and C. Hudin, 'Confinement of Vibrotactile Stimuli in Narrow "
        "Plates'. What the paper does not state (waits, breaks, the device) is ours. Every key may "
        "be left out: the paper preset's value is its default; but a plate of other width, "
        "thickness or material needs its own material, edge or measured_cutoff_hz, and actuators."
    ),
    "recommended": (
        "The paper's plate with the design we recommend: each level equally often in every block, "
        "'none' as an answer and 60 blank trials to measure guesses, a Hann window to confine the "
        "burst, practice before the first block."
    ),
}
_LEVELS: Final = {
    "paper": "",
    "recommended": (
        "The levels below are for a pilot session. Place each participant's own afterwards, in a "
        "file with levels_vpp = [...], and give it with `tactstrip run --levels FILE`."
    ),
}
_CONDITIONS: Final = """\
# To compare stimuli, list conditions; each runs the whole design. What one leaves out is taken from
# [burst]. Without any there is one condition, main.
# [[condition]]
# name = "two-cycles"
# cycles = 2
"""
_COLUMN: Final = 37
"""Where a key's comment begins, unless the value is longer."""
_WIDTH: Final = 100


def write_study_text(preset: str) -> str:
    r"""Write a commented study file of a preset, ``paper`` or ``recommended``.

    The first reads back as `experiment.study.read.paper_study`; comments, keys and values come from
    the sections that read it.

    >>> lines = write_study_text("paper").splitlines()
    >>> print(*lines[lines.index("[masking]"):][:3], sep="\n")
    [masking]
    noise = "pink"                         # pink | none
    max_level_dba = 75                     # at the ear; 80 at most
    """
    from experiment.study.study import Study

    require_word("preset", preset, PRESETS)
    study = Study(**_OVERRIDES[preset])
    sections = [_comment(_INTRODUCTIONS[preset])]
    for name, table in study.sections().items():
        if name == "condition":
            sections.append(_CONDITIONS)
        elif isinstance(table, tuple):
            first, *others = table
            sections.append(_section(f"[[{name}]]", first))
            sections += [f"[[{name}]]\n{_keys(other, commented=False)}" for other in others]
        else:
            sections.append(
                _section(f"[{name}]", table, _LEVELS[preset] if name == "design" else "")
            )
    return "\n".join(sections)


def _section(heading: str, table: object, remark: str = "") -> str:
    about = _comment(type(table).__doc__ or "") + _comment(remark)
    return f"{about}{heading}\n{_keys(table, commented=True)}"


def _keys(table: object, *, commented: bool) -> str:
    """Write a table's keys; one that is not set stands as a comment, for who needs it."""
    from experiment.study.sections.table import file_keys

    lines = []
    for key, field in file_keys(type(table)).items():
        value = getattr(table, key)
        line = f"# {key} =" if value is None else f"{key} = {_toml(value)}"
        comment = "; ".join(filter(None, (_words(field.annotation), field.description)))
        if len(line) > _WIDTH and isinstance(value, str):
            line = _wrapped(key, value)
        if commented and comment:
            lines.append(_beside(line, comment))
        elif commented or value is not None:
            lines.append(line)
    return "".join(f"{line}\n" for line in lines)


def _beside(line: str, comment: str) -> str:
    """Put a comment behind a key, or above where there is no room."""
    together = f"{line:{_COLUMN}}  # {comment}"
    fits = max(map(len, together.split("\n"))) <= _WIDTH
    return together if fits else f"# {comment}\n{line}"


def _wrapped(key: str, text: str) -> str:
    """Write a long text over several lines; a line's last backslash joins it to the next."""
    lines = textwrap.wrap(_toml(text)[1:-1], width=_WIDTH - 6, break_on_hyphens=False)
    return f'{key} = """\\\n    ' + " \\\n    ".join(lines) + '"""'


def _words(annotation: object) -> str:
    """List the words of a key that takes one of several."""
    if get_origin(annotation) in {Union, UnionType}:
        return "".join(_words(member) for member in get_args(annotation))
    words = get_args(annotation) if get_origin(annotation) is Literal else ()
    return " | ".join(words) if len(words) > 1 else ""


def _comment(text: str) -> str:
    return "".join(
        f"# {line}\n"
        for line in textwrap.wrap(" ".join(text.split()), width=98, break_on_hyphens=False)
    )


def _toml(value: object) -> str:
    """Write a value in TOML; JSON's texts are TOML's, and a whole number needs no point."""
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(item) for item in value)}]"
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return json.dumps(value)


@click.command()
@click.argument(
    "file", metavar="[FILE]", type=click.Path(path_type=Path), default=Path("study.toml")
)
@click.option(
    "--preset",
    type=click.Choice(PRESETS),
    default="paper",
    show_default=True,
    help="The paper's protocol, or the one we recommend.",
)
@refusals
def init(*, file: Path, preset: str) -> None:
    """Write a commented study file, study.toml by default; an existing one is left alone."""
    from experiment.archive.files import write_atomically

    text = write_study_text(preset)
    try:
        file.open("x").close()
    except FileExistsError as error:
        raise CommandError(f"{file} exists and is left as it is; name another file") from error
    try:
        write_atomically(file, text)
    except OSError:
        file.unlink(missing_ok=True)
        raise
    click.echo(f"{file} holds the {preset} preset; next: tactstrip check {file}")

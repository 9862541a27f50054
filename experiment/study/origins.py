"""A number of a study with its source: the paper, the lab, a handbook, or nobody but us."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

from experiment.study.base import file_keys, stated_of
from experiment.study.simulation import PAPER_THRESHOLD_UM, THRESHOLD_VPP

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

Origin = Literal["paper", "yours", "measured", "handbook", "computed", "assumed"]

# What the paper states of its experiment. All other values that a study leaves out are ours.
_OF_THE_PAPER: Final = frozenset(
    (
        "burst.frequency_hz",
        "burst.cycles",
        "design.levels_vpp",
        "design.trials_per_side",
        "design.both_trials",
    )
)
_FILLED_IN: Final = {
    "simulation.threshold_um": PAPER_THRESHOLD_UM,
    "simulation.threshold_vpp": THRESHOLD_VPP,
}
"""Defaults that another section decides on."""

_WORKED_OUT: Final = {"trials_per_side": "repeats_per_level", "both_trials": "both_fraction"}
"""Numbers of trials by what a file may state in their place."""

_FOUND: Final = {
    "auto_cycles": "computed: the shortest window with the wanted level",
    "sample_rate_hz": "computed: the file was resampled to the device's rate",
}
"""Numbers of a condition that nobody states."""

_WHOSE: Final = {
    "paper": "the paper's",
    "yours": "yours",
    "assumed": "assumed by tactstrip",
    "computed": "computed",
}

PAPERS: Final[tuple[Origin, str]] = ("paper", "the paper's")
YOURS: Final[tuple[Origin, str]] = ("yours", "yours")
ASSUMED: Final[tuple[Origin, str]] = ("assumed", "assumed by tactstrip")
CHOSEN: Final[tuple[Origin, str]] = ("assumed", "chosen by tactstrip init")


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A number of a study by its key in the file, and where it is from."""

    key: str
    value: Any  # a number, several, or a word that stands for some
    origin: Origin
    words: str

    @property
    def printed(self) -> str:
        """The value in words."""
        if isinstance(self.value, bool):
            return str(self.value).lower()  # as in the file
        values = self.value if isinstance(self.value, tuple | list) else [self.value]
        return ", ".join(f"{one:.6g}" if isinstance(one, float) else str(one) for one in values)

    @property
    def facts(self) -> dict[str, Any]:
        """The same to other programs."""
        value = list(self.value) if isinstance(self.value, tuple) else self.value
        return {"value": value, "source": self.origin, "words": self.words}


def sources_of_facts(facts: Mapping[str, Mapping[str, Any]]) -> tuple[Source, ...]:
    """Return the sources that a plan holds, by their keys, as `Source.facts`.

    >>> facts = {"strip.width_mm": {"value": 30.0, "source": "yours", "words": "yours"}}
    >>> [(one.printed, one.origin) for one in sources_of_facts(facts)]
    [('30', 'yours')]
    """
    found = []
    for key, one in facts.items():
        value, origin = one["value"], one["source"]
        if origin not in get_args(Origin):
            raise ValueError(f"source must be one of {', '.join(get_args(Origin))}; got {origin!r}")
        if isinstance(value, list):
            value = tuple(value)
        found.append(Source(key=key, value=value, origin=origin, words=one["words"]))
    return tuple(found)


def source(key: str, value: Any, origin: Origin, words: str) -> Source:
    """Return a source, its fields in their order."""
    return Source(key=key, value=value, origin=origin, words=words)


def stated(section: object, key: str, *, by_value: bool) -> tuple[Origin, str] | None:
    """Return whose a value is, or that it was chosen; none where it was left out.

    Parameters
    ----------
    section : object
        A section of a study.
    key : str
        Its key.
    by_value : bool
        What is said where nobody recorded what was stated: whether the value is another one than
        that of a key left out.
    """
    told = stated_of(section)
    if told.keys is None:
        return YOURS if by_value else None
    if key in told.keys:
        return YOURS
    return CHOSEN if key in told.chosen else None


def plain_sources(path: str, section: object, shared: object | None = None) -> Iterator[Source]:
    """Yield the numbers of a section; those of a condition may be those of [burst]."""
    for key, field in file_keys(type(section)).items():
        name, value = f"{path}.{key}", getattr(section, key, None)
        if instead := _stated_instead(section, key):
            yield source(f"{path}.{instead[0]}", instead[1], *YOURS)
            yield source(name, value, "computed", f"computed from {instead[0]}, yours")
            continue
        first = value[0] if isinstance(value, tuple) and value else value
        if isinstance(first, bool) or not isinstance(first, int | float):
            continue
        if shared is not None:
            own = stated(section, key, by_value=value != getattr(shared, key, None))
            if key in _FOUND:
                yield source(name, value, "computed", _FOUND[key])
            elif own is not None:
                yield source(name, value, *own)
            continue
        default = _FILLED_IN.get(name, field.get_default(call_default_factory=True))
        whose = stated(section, key, by_value=value != default)
        yield source(name, value, *(whose or (PAPERS if name in _OF_THE_PAPER else ASSUMED)))


def instead_of_trials(design: object) -> dict[str, Any]:
    """Return what a section [design] states in the place of numbers of trials."""
    found = (_stated_instead(design, key) for key in _WORKED_OUT)
    return dict(one for one in found if one is not None)


def _stated_instead(section: object, key: str) -> tuple[str, Any] | None:
    """Return the key, and its value, in the place of which a number of trials was worked out."""
    instead, told = _WORKED_OUT.get(key, ""), stated_of(section).keys or {}
    return (instead, told[instead]) if instead in told else None


def counted(sources: Iterable[Source]) -> str:
    """Count whose numbers are."""
    origins: list[str] = [one.origin for one in sources]
    return ", ".join(
        f"{origins.count(origin)} {words}"
        for origin, words in _WHOSE.items()
        if origin in origins or origin != "computed"
    )


_DECIDING: Final = {
    "design.levels_vpp": "V: do some lie below the threshold, some above?",
    "device.ceiling_vpp": "V: do amplifier and actuators bear it?",
    "masking.level_dbfs": "dB: is the noise loud enough, and no louder?",
    "simulation.threshold_um": "um: of simulated people only, as are all of simulation",
    "simulation.threshold_vpp": "V: of simulated people only, as are all of simulation",
}
"""Numbers that a lab should look at before it leaves them as they are, and what to ask of them.

Of those not of the plate: the others say how something is done, and suit most laboratories.
"""


def deciding_words(sources: Iterable[Source]) -> list[str]:
    r"""Return the assumed numbers that a result or somebody's safety hangs on, a line each.

    >>> from experiment.study.files import paper_study
    >>> from experiment.study.sources import study_sources
    >>> print(*deciding_words(study_sources(paper_study()))[:2], sep="\n")
    look at these, which are assumed:
      device.ceiling_vpp = 200 V: do amplifier and actuators bear it?
    """
    told = [one for one in sources if one.origin == "assumed" and one.key in _DECIDING]
    lines = [f"  {one.key} = {one.printed} {_DECIDING[one.key]}" for one in told]
    last = "  the others are defaults; the study file that init writes explains each"
    return ["look at these, which are assumed:", *lines, last] if told else []

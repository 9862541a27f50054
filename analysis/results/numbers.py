"""The numbers of the studies that were analyzed, each with its source, as a report tells them."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Final

from analysis.results.markup import element, foreign, table

if TYPE_CHECKING:
    from collections.abc import Iterator
    from xml.etree.ElementTree import Element

    from analysis.results.markup import Content
    from analysis.results.tables import Analysis
    from experiment.study.origins import Source


def plates(analysis: Analysis) -> Iterator[Element]:
    """Tell what plates and stimuli are known by; sessions whose plates are the same at once."""
    yield element("h2", "The plate")
    told: list[list[Source]] = []
    others: dict[str, dict[tuple[str, str], None]] = {}
    for text, sealed in analysis.studies:
        try:
            sources, recorded = _numbers(text, sealed)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            yield element("p", foreign(f"A plan's plate is not told here: {error}"))
            continue
        if not recorded:
            yield element(
                "p",
                "A plan does not hold what its study file stated: whose a number is, is told by "
                "its value.",
            )
        plate = [one for one in sources if one.key.startswith(_OF_PLATE)]
        if plate not in told:
            told.append(plate)
        for one in sources:
            if one not in plate:
                others.setdefault(one.key, {})[one.printed, one.words] = None
    if not told:
        yield element("p", "No plan beside the tables tells of a plate.")
    for place, plate in enumerate(told, start=1):
        which = f"plate {place} of {len(told)}" if len(told) > 1 else "the plate"
        rows: list[list[Content]] = [
            [element("code", foreign(one.key)), foreign(one.printed), foreign(one.words)]
            for one in plate
        ]
        yield table(f"What is known of {which}, and from whom (yours: the study's)", _NUMBER, rows,
                    _NUMBER[2:])  # fmt: skip
    if others:
        rows = [
            [
                element("code", foreign(key)),
                foreign(next(iter(values))[0] if len(values) == 1 else f"{len(values)} different"),
                foreign("; ".join(dict.fromkeys(words for _, words in values))),
            ]
            for key, values in others.items()
        ]
        yield table("Numbers of stimuli, design and devices, and from whom", _NUMBER, rows,
                    _NUMBER[2:])  # fmt: skip


_NUMBER: Final = ["Number, by its key in study.toml", "Value", "Source"]
_OF_PLATE: Final = ("strip.", "actuator[", "finger_load", "level_db.")


def _numbers(text: str, sealed: str) -> tuple[tuple[Source, ...], bool]:
    """Return the sources of a study's numbers, and whether its plan holds them."""
    from experiment.study.origins import sources_of_facts
    from experiment.study.read import study_from_canonical
    from experiment.study.sources import study_sources

    found = sources_of_facts(json.loads(sealed))
    return (found, True) if found else (study_sources(study_from_canonical(text)), False)

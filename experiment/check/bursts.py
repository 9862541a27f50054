"""Bursts on one plate: each checked like a study's burst, with its edge and the alternative one."""

from __future__ import annotations

import contextlib
import math
from itertools import product
from typing import TYPE_CHECKING, Any, Final

from experiment.check.check import check_study, with_each_edge
from experiment.perception.thresholds import ReferenceVibration
from experiment.study.base import Fault
from experiment.study.physics import MAX_LOSS, MIN_LOSS, driven_per_load_m, study_gains
from experiment.study.threshold import median_threshold, vibrations_of
from stimuli import Burst

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from experiment.check.check import ConditionCheck, Verdict
    from experiment.study.study import Study
    from stimuli.drive.windows import Window

SCHEMA: Final = 2
FREQUENCIES_HZ: Final = (200.0, 250.0, 300.0, 400.0, 500.0)
"""Frequencies to which skin is sensitive."""

CYCLES: Final = (1, 2, 3)
_DIGITS: Final = 9
"""Durations are equal to a nanosecond."""


Row = dict[str, Any]
"""A burst in the JSON output of `tactstrip bursts`."""


def length_order(duration_s: float, frequency_hz: float) -> tuple[float, float]:
    """Return the key that sorts bursts by length, then by frequency.

    Of equally long bursts, that of the lower frequency stays further below the cut-off, and skin is
    most sensitive at 250 Hz.

    >>> length_order(1 / 250, 250.0) < length_order(2 / 500, 500.0)
    True
    """
    return round(duration_s, _DIGITS), frequency_hz


def with_burst(
    study: Study, frequency_hz: float, cycles: int, window: Window | None = None
) -> Study:
    """Return a study with another sine in [burst], and no other conditions.

    Its window is that of [burst] unless another is given. ValueError if [burst] has no standard
    window either, or if the burst does not suit the study.
    """
    burst = study.burst
    if window is None and (burst.file is not None or burst.window == "auto"):
        key, got = ("file", burst.file) if burst.file is not None else ("window", "auto")
        rule = "has no window to compare bursts with; give --window, such as --window hann"
        raise study.refused(Fault(f"burst.{key}", rule, got))
    omitted = {"max_crosstalk_db", "file", "accept_violation"}
    shared = {key: getattr(burst, key) for key in burst.model_fields_set - omitted}
    shared |= {"frequency_hz": frequency_hz, "cycles": cycles, "window": window or burst.window}
    return study.changed(burst=shared, condition=[{"name": "main"}])


def grid_of(
    study: Study, frequencies_hz: Iterable[float] = (), cycles: Iterable[int] = ()
) -> tuple[tuple[float, int], ...]:
    """Return the bursts to compare; by default common ones and the study's.

    >>> from experiment.study.files import paper_study
    >>> grid_of(paper_study(), (300, 100), (1,))
    ((100, 1), (300, 1))
    """
    stimuli = [study.burst, *study.conditions]
    study_hz = (of.frequency_hz or FREQUENCIES_HZ[0] for of in stimuli)
    every_hz = [*frequencies_hz] or [*FREQUENCIES_HZ, *study_hz]
    every_cycles = [*cycles] or [*CYCLES, *(of.cycles or CYCLES[0] for of in stimuli)]
    return tuple(product(sorted(set(every_hz)), sorted(set(every_cycles))))


def compare_bursts(
    study: Study,
    bursts: Iterable[tuple[float, int]],
    step: Callable[[int, int], object],
    *,
    file_name: str,
    window: Window | None = None,
) -> dict[str, Any]:
    """Check bursts on the plate of a study, with its edge and with the alternative one.

    The report is the JSON output of `tactstrip bursts`. Its `best` is the shortest burst within
    limits with all edges, or else with the study's edge, and None if there is none. Thresholds in
    dB refer to the burst in `reference`.

    Parameters
    ----------
    study : Study
        The study; a burst that it accepts with a reason is not accepted here.
    bursts : iterable of (float, int)
        Frequencies in Hz and cycles.
    step : callable
        Called with the number of bursts that are done, and with that of all.
    file_name : str
        The file of the study.
    window : str, optional
        Of all bursts, instead of that in [burst].

    Raises
    ------
    ValueError
        If none of them can be checked.
    """
    every, rows, sines = tuple(bursts), list[Row](), list[Burst]()
    shared = study.burst
    reference, reference_m = study.simulation.reference_vibration, None
    if not reference.values:
        with contextlib.suppress(ValueError):  # others may do where the study's burst does not
            alone = with_burst(
                study, shared.frequency_hz or FREQUENCIES_HZ[0], shared.cycles or CYCLES[0]
            )
            reference_m = driven_per_load_m(alone)
            sine = alone.conditions[0].sine
            reference = ReferenceVibration(
                frequency_hz=sine.frequency_hz, duration_s=sine.energy_duration_s
            )
    for index, (frequency_hz, cycles) in enumerate(every):
        step(index, len(every))
        changed = with_burst(study, frequency_hz, cycles, window)
        sines.append(changed.conditions[0].sine)
        rows.append(_compare(study, changed, reference, reference_m))
    if all(row["edges"][0]["verdict"] is None for row in rows):
        raise ValueError(rows[0]["edges"][0]["reasons"][0])
    return {
        "schema": SCHEMA,
        "file": file_name,
        "study": {"name": study.name, "sha256": study.sha256},
        "edges": [
            {"edge": of.plate.edge, "cutoff_hz": of.strip.cutoff_hz()}
            for of in with_each_edge(study)
        ],
        "window": sines[0].window,
        "study_window": shared.window,
        "max_energy_above_cutoff": shared.max_energy_above_cutoff,
        "masking_threshold_db": shared.masking_threshold_db,
        "level_vpp": study.design.highest_vpp,
        "loss_factors": None if study.plate.has_loss_factor else (MIN_LOSS, MAX_LOSS),
        "reference": (
            None
            if reference_m is None
            else {"frequency_hz": shared.frequency_hz, "cycles": shared.cycles}
        ),
        "extrapolations": reference.extrapolations(
            *(vibration for sine in sines for vibration in vibrations_of(study, sine))
        ),
        "bursts": sorted(rows, key=_threshold_order),
        "best": _best(rows),
    }


def _threshold_order(row: Row) -> tuple[bool, float, float, int]:
    """Sort by threshold where it is known, else by frequency and cycles."""
    thresholds = [row[key] for key in ("threshold_vpp", "threshold_db") if row[key] is not None]
    threshold = thresholds[0] if thresholds else 0.0
    return (not thresholds, threshold, row["frequency_hz"], row["cycles"])


def _best(rows: list[Row]) -> Row | None:
    """Return the shortest burst within limits: with all edges, else with the study's edge."""
    with_all = [row for row in rows if row["within_limits"]]
    with_first = [row for row in rows if row["edges"][0]["verdict"] == "within limits"]
    return min(
        with_all or with_first,
        key=lambda row: length_order(row["duration_s"], row["frequency_hz"]),
        default=None,
    )


def _threshold_db(study: Study, reference: ReferenceVibration, reference_m: float) -> float:
    """Return the threshold of a burst in volts: by the curves, and by how much the plate moves."""
    both = vibrations_of(study, study.conditions[0].sine)
    curve_db = sum(map(reference.shift_db, both)) / len(both)
    return curve_db - 20 * math.log10(driven_per_load_m(study) / reference_m)


def _compare(
    study: Study, tried: Study, reference: ReferenceVibration, reference_m: float | None
) -> Row:
    """Check the only burst of a study with each edge.

    The threshold is that of the median simulated participant in Vpp, if the study says for which
    vibration its threshold holds, and else in dB re the burst in [burst], by published curves.
    """
    burst, level_vpp = tried.conditions[0].sine, study.design.highest_vpp
    (check, first), *others = (_at_edge(each) for each in with_each_edge(tried))
    edges = [first, *(edge for _, edge in others)]
    threshold_vpp = threshold_db = None
    if check is not None and check.gains is not None:
        if study.simulation.reference_vibration.values:
            threshold_vpp = median_threshold(
                tried, check.gains.at_fingers(tried.task.sites)
            ).threshold_vpp
        elif reference_m is not None:
            threshold_db = _threshold_db(tried, reference, reference_m)
    return {
        "frequency_hz": burst.frequency_hz,
        "cycles": burst.cycles,
        "duration_s": burst.duration_s,
        "conditions": [of.name for of in study.conditions if of.drive == burst],
        "edges": edges,
        "peak_um": {
            site: None if check is None else check.peak_um(index, index, level_vpp)
            for index, site in enumerate(study.task.sites)
        },
        "threshold_vpp": threshold_vpp,
        "threshold_db": threshold_db,
        "within_limits": all(edge["verdict"] == "within limits" for edge in edges),
    }


def _at_edge(study: Study) -> tuple[ConditionCheck | None, dict[str, Any]]:
    """Check the only burst of a study; without numbers if it cannot be computed."""
    numbers = ("energy_above_cutoff", "staircase_energy_above_cutoff")
    edge: dict[str, Any] = {"edge": study.plate.edge}
    try:
        (check,) = check_study(study).conditions
    except ValueError as error:
        edge |= {"verdict": None, "reasons": [str(error)]}
        names = (*numbers, "largest_energy_above_cutoff", "crosstalk_db", "crosstalk_error_db")
        return None, edge | dict.fromkeys(names)
    edge |= {"verdict": check.verdict, "reasons": check.reasons}
    energies = {key: getattr(check.burst, key) for key in numbers}
    energies["largest_energy_above_cutoff"] = max(energies.values())
    crosstalk = {name: getattr(check, name) for name in ("crosstalk_db", "crosstalk_error_db")}
    return check, edge | energies | crosstalk


# --- the burst of a new plate ---------------------------------------------------------------------

CANDIDATES: Final = sorted(
    product(FREQUENCIES_HZ, CYCLES), key=lambda burst: length_order(burst[1] / burst[0], burst[0])
)
"""The bursts that are tried on a new plate, under a Hann window, the shortest first."""


def chosen_burst(
    make_study: Callable[[dict[str, Any]], Study], step: Callable[[int, int], object]
) -> tuple[Study, dict[str, Verdict]]:
    """Return the study with the shortest candidate within limits, and its verdict with each edge.

    Where the edges are ideal and no cut-off was measured, a burst that is within limits with the
    other ideal edge, too, comes before all that are not. If no burst is within limits, it is the
    shortest.

    Parameters
    ----------
    make_study : callable
        Returns the plate's study with the keys of [burst] that it is given.
    step : callable
        Called with the number of candidates that were tried, and with that of all.
    """
    choices: list[tuple[Study, dict[str, Verdict]]] = []
    for index, (frequency_hz, cycles) in enumerate(CANDIDATES):
        step(index, len(CANDIDATES))
        study, *alternative = with_each_edge(
            make_study({"frequency_hz": frequency_hz, "cycles": cycles, "window": "hann"})
        )
        verdicts: dict[str, Verdict] = {study.plate.edge: _verdict(study)}
        if verdicts[study.plate.edge] == "within limits":
            verdicts |= {each.plate.edge: _verdict(each) for each in alternative}
        if set(verdicts.values()) == {"within limits"}:
            return study, verdicts
        choices.append((study, verdicts))
    return next((choice for choice in choices if "within limits" in choice[1].values()), choices[0])


def _verdict(study: Study) -> Verdict:
    """Check a study's burst; most violations are found with little work.

    The energy above the cut-off needs no field at all, and the least assumed loss gives the most
    crosstalk as a rule. Only a burst that passes both is worth the whole check.
    """
    verdict = check_study(study, gains=()).verdict
    if verdict == "within limits":
        verdict = check_study(study, gains=study_gains(study, MIN_LOSS)).verdict
    return check_study(study).verdict if verdict == "within limits" else verdict

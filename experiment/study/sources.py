"""Where every number of a study is from: the paper, the lab, a handbook, or nobody but us."""

from __future__ import annotations

from itertools import permutations
from math import isfinite
from typing import TYPE_CHECKING, Final

from experiment.perception.gains import OWN_FINGERS
from experiment.study.actuator import (
    CARRIER_PATCH_KEYS,
    MEASURED_KEYS,
    PATCH_KEYS,
    PIEZO_KEYS,
    Actuator,
    paper_actuators,
)
from experiment.study.finger import FINGER_KEYS
from experiment.study.origins import (
    ASSUMED,
    PAPERS,
    YOURS,
    Origin,
    Source,
    counted,
    plain_sources,
    source,
    stated,
)
from experiment.study.plate import PAPER_CUTOFF_HZ, PAPER_LENGTH_MM, Plate
from stimuli import MATERIALS, ElasticEdge
from stimuli.strip.patch import laminate, layer_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from experiment.perception.gains import ConditionGains
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study
    from stimuli import BondedPatch, Strip

_MATERIAL_KEYS: Final = ("youngs_modulus_gpa", "poisson_ratio", "density_kg_m3")


def study_sources(study: Study) -> tuple[Source, ...]:
    """Return the source of every number of a study, in the order of its sections.

    A number that the study's file states is the lab's, whatever its value. Of a study that is read
    again from its plan nobody knows what was stated: there a number is told by its value. A plan
    holds the sources of its own study.

    Parameters
    ----------
    study : Study
        The study.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> found = {one.key: one for one in study_sources(paper_study())}
    >>> found["strip.measured_cutoff_hz"].words
    'measured by the paper (figure 4)'
    >>> found["strip.loss_factor"].origin, found["design.levels_vpp"].origin
    ('assumed', 'paper')
    """
    found = [*plate_sources(study)]
    elsewhere = {"strip", "actuator", "finger_load"}
    unused = {"monitor"} if study.monitor.source == "none" else set()
    for name, table in study.sections().items():
        if name not in elsewhere | unused:
            tables = table if isinstance(table, tuple) else (table,)
            for place, one in enumerate(tables):
                path = f"{name}[{place}]" if isinstance(table, tuple) else name
                found += plain_sources(path, one, study.burst if name == "condition" else None)
    return tuple(found)


def planned_sources(study: Study, gains: Iterable[ConditionGains]) -> tuple[Source, ...]:
    """Return the sources of a study's numbers, and of the levels that its gain matrices have."""
    return (*study_sources(study), *_levels(study, gains))


def _levels(study: Study, gains: Iterable[ConditionGains]) -> Iterator[Source]:
    from experiment.study.physics import ASSUMED_LOSS

    with_loss = "" if study.plate.is_loss_stated else f"; loss factor {ASSUMED_LOSS:g} (assumed)"
    load, drives = study.finger_load.impedance, {one.name: one.drive for one in study.conditions}
    for one in gains:
        drive = drives.get(one.condition)
        rests = load is not None and drive is not None and load.holds_for(drive)
        with_load = "; with the finger load" if rests else ""
        for own, other in permutations(range(len(OWN_FINGERS)), 2):
            level_db = one.level_db(other, own)
            if isfinite(level_db):
                words = (
                    f"computed: dB at the {OWN_FINGERS[other]} finger re the {OWN_FINGERS[own]} "
                    f"one, whose actuator is driven{with_loss}{with_load}"
                )
                key = f"{LEVEL}{one.condition}.{OWN_FINGERS[own]}"
                yield source(key, round(level_db, 3), "computed", words)


LEVEL: Final = "level_db."
"""How the keys of levels at the other finger begin, which are no keys of a study's file."""


def plate_sources(study: Study) -> tuple[Source, ...]:
    r"""Return the sources of the numbers of the plate and of what moves it.

    >>> from experiment.study.files import study_from_text
    >>> study = study_from_text("[strip]\nmeasured_cutoff_hz = 2500", "s.toml")
    >>> [one.words for one in plate_sources(study) if one.key == "strip.measured_cutoff_hz"]
    ['measured (by: not stated; on: not stated)']
    """
    found = list(_strip(study.plate))
    for place, actuator in enumerate(study.actuators):
        path = f"actuator[{place}]"
        found += _placed(study, actuator, path)
        if actuator.patch_counts:
            words = "yours: its layers stiffen and load the plate"
            found.append(source(f"{path}.patch_counts", actuator.patch_counts, "yours", words))
            layers = (*PATCH_KEYS, *CARRIER_PATCH_KEYS)
            given = [(key, getattr(actuator, key)) for key in layers]
            found += [source(f"{path}.{k}", v, *YOURS) for k, v in given if v is not None]
        displacement = displacement_source(study, place)
        found += [displacement] if displacement else []
        if displacement and displacement.origin == "measured" and actuator.measured_as is None:
            found.append(source(f"{path}.measured_as", "peak", "assumed", _TAKEN_AS_PEAK))
    return (*found, *finger_sources(study))


def _placed(study: Study, actuator: Actuator, path: str) -> Iterator[Source]:
    """Yield the sources of an actuator's place and size, and of its finger's contact."""
    papers = _is_the_papers(study, actuator)
    is_own = stated(actuator, "x_mm", by_value=not papers) is not None
    for key in ("x_mm", "y_mm", "diameter_mm", "length_x_mm", "length_y_mm"):
        value = getattr(actuator, key)
        if value is not None:
            whose = stated(actuator, key, by_value=not papers)
            default = PAPERS if study.plate.is_the_papers else ASSUMED
            left_out = _MIDDLE if is_own and key == "y_mm" else default
            yield source(f"{path}.{key}", value, *(whose or left_out))
    key, value = "finger_diameter_mm", actuator.finger_diameter_mm
    whose = stated(actuator, key, by_value=value != _FINGER_DIAMETER_MM)
    yield source(f"{path}.{key}", value, *(whose or ASSUMED))


_MIDDLE: Final[tuple[Origin, str]] = ("assumed", "assumed: the middle of the plate's width")
_FINGER_DIAMETER_MM: Final = 10.0


def finger_sources(study: Study) -> Iterator[Source]:
    """Yield the sources of what the fingers oppose to the plate; none where they do not."""
    load = study.finger_load
    if load.impedance is None:
        return
    for key in FINGER_KEYS[:-1]:
        yield source(f"finger_load.{key}", getattr(load, key), "yours", f"yours: {load.source}")
    above = [one.name for one in study.conditions if not load.impedance.holds_for(one.drive)]
    if above:
        words = "left out: their bursts reach above the band of its values"
        yield source("finger_load", tuple(above), "computed", words)


def finger_words(study: Study, condition: Condition) -> tuple[str, ...]:
    """Say what the fingers oppose to the plate under a condition's burst, and how far that goes.

    >>> from experiment.study.files import paper_study
    >>> study = paper_study()
    >>> finger_words(study, study.conditions[0])
    ()
    """
    load = study.finger_load
    if load.impedance is None:
        return ()
    told = (
        f"finger load: {load.mass_g:g} g, {load.stiffness_n_m:g} N/m, {load.damping_n_s_m:g} N s/m "
        f"(yours: {load.source})"
    )
    upto = f"{load.holds_up_to_hz:g} Hz"
    if not load.impedance.holds_for(condition.drive):
        upper_hz = condition.drive.band_hz()[1]
        return told, f"left out: it holds up to {upto}, the burst's band reaches {upper_hz:.0f} Hz"
    return (
        told,
        f"it holds up to {upto}; the other finger gets what lies above the cut-off, so that the",
        "levels are the worse of those with and without it",
    )


def plate_words(plate: Plate) -> str:
    """Say where a plate's sizes and material are from.

    >>> from experiment.study.files import paper_study
    >>> plate_words(paper_study().plate)
    "sizes: the paper's; material: the paper's (section II-B)"
    """
    sources = {one.key.removeprefix("strip."): one for one in _strip(plate)}
    sizes = {name: sources[f"{name}_mm"].words for name in ("width", "length", "thickness")}
    told = ", ".join(f"{name} {words}" for name, words in sizes.items())
    if len(set(sizes.values())) == 1:
        told = sizes["width"]
    if plate.material is not None:
        return f"sizes: {told}; material: {plate.material}, {sources['material'].words}"
    return f"sizes: {told}; material: {sources['youngs_modulus_gpa'].words}"


def words_of_the_others(study: Study) -> str:
    """Count whose the numbers are that are not of the plate.

    >>> from experiment.study.files import paper_study
    >>> words_of_the_others(paper_study()).split(", ")[:2]
    ["5 the paper's", '0 yours']
    """
    return counted(others_than_the_plates(study))


def others_than_the_plates(study: Study) -> list[Source]:
    """Return the sources of the numbers that are not of the plate and what moves it."""
    of_plate = ("strip.", "actuator[", "finger_load")
    return [one for one in study_sources(study) if not one.key.startswith(of_plate)]


def measured_beside(plate: Plate) -> tuple[float, list[str]] | None:
    """Compare a cut-off that was measured, and is no part of the model, with the model's.

    Returns by which part it lies above, and what to say of it; none where there is none.
    """
    measured_hz = plate.measured_cutoff_hz
    if measured_hz is None or plate.edge == "measured-cutoff":
        return None
    computed_hz = plate.strip.cutoff_hz()
    off = measured_hz / computed_hz - 1
    side = "above" if off > 0 else "below"
    words = cutoff_source(plate).words
    told = [f"{measured_hz:g} Hz, {words}: {abs(off):.1%} {side} the computed one"]
    if plate.edge != "elastic" and abs(off) > _NEAR:
        edges = plate.edge.replace("-", " ")
        told.append(f"{edges}, {measured_hz:g} Hz {plate.fitting(computed_hz, measured_hz)}")
    return off, told


_NEAR: Final = 0.02
"""A cut-off that is off by more says that a size or an edge is not as stated."""


_TAKEN_AS_PEAK: Final = "taken as peak (assumed; measured_as says otherwise)"


def displacement_source(study: Study, place: int) -> Source | None:
    """Return where the displacement per volt of an actuator is from; none where it is not known."""
    actuator = study.actuators[place]
    path = f"actuator[{place}]"
    if actuator.measured_displacement_um is None:
        if actuator.piezo_d31_pm_v is None:
            return None
        layers = [getattr(actuator, key) for key in PIEZO_KEYS]
        return source(
            f"{path}.piezo", layers, "computed", "displacement predicted from its layers, yours"
        )
    um, vpp, hz = (getattr(actuator, key) for key in MEASURED_KEYS)
    key = f"{path}.{MEASURED_KEYS[0]}"
    alike = [one for one in study.actuators if one.side == actuator.alike]
    (known,) = alike or [actuator]
    papers = study.plate.is_as_measured and known.is_the_papers
    what = known.measured_as or ("peak" if papers else _TAKEN_AS_PEAK)
    own = f"{um:g} um {what}"
    if what == "peak-to-peak":  # of an actuator assumed alike the value is the peak already
        peak_um = um if alike else um / 2
        own = f"{2 * peak_um:g} um {what} ({peak_um:g} um peak)"
    at = f"{own} at {vpp:g} Vpp and {hz:g} Hz"
    if alike:
        words = f"{at}, not measured: assumed equal to the {actuator.alike} actuator's"
        return source(key, um, "assumed", f"{words}, {_measured(known)}")
    if papers:
        return source(key, um, "paper", f"{at}, measured by the paper (section III-B)")
    return source(key, um, "measured", f"{at}, {_measured(actuator)}")


def patch_words(strip: Strip, patch: BondedPatch) -> str:
    """Say what a patch that counts does to its plate."""
    plate = layer_of(strip.material, strip.thickness_m)
    alone, both = laminate([plate]), laminate([plate, *patch.layers])
    return (
        f"its layers, yours, make the plate {both.biaxial_n_m / alone.biaxial_n_m:.3g} times as "
        f"stiff and {both.mass_kg_m2 / alone.mass_kg_m2:.3g} times as heavy there, without glue"
    )


def _strip(plate: Plate) -> Iterator[Source]:
    for key in ("width_mm", "length_mm", "thickness_mm"):
        value = getattr(plate, key)
        papers = plate.is_the_papers and (key != "length_mm" or value == PAPER_LENGTH_MM)
        left_out = PAPERS if papers else ASSUMED
        yield source(f"strip.{key}", value, *(stated(plate, key, by_value=not papers) or left_out))
    if plate.material is not None:
        words = f"handbook: {MATERIALS[plate.material].source}"
        yield source("strip.material", plate.material, "handbook", words)
    for key in _MATERIAL_KEYS if plate.material is None else ():
        whose = stated(plate, key, by_value=not plate.is_the_papers)
        left_out = _PAPERS_MATERIAL if plate.is_the_papers else ASSUMED
        yield source(f"strip.{key}", getattr(plate, key), *(whose or left_out))
    yield from _loss(plate)
    yield from _edge(plate)


def _edge(plate: Plate) -> Iterator[Source]:
    whose = stated(plate, "edge", by_value=plate.edge != "measured-cutoff")
    yield source("strip.edge", plate.edge, *(whose or _SPRINGS))
    if plate.edge_stiffness_n is not None:
        yield source("strip.edge_stiffness_n", plate.edge_stiffness_n, *YOURS)
    if isinstance(plate.strip.edge, ElasticEdge):
        whose = stated(plate, "edge_loss", by_value=plate.edge_loss != "none")
        yield source("strip.edge_loss", plate.edge_loss, *(whose or _LOSSLESS))
    if plate.measured_cutoff_hz is not None:
        yield cutoff_source(plate)
    if plate.edge != "measured-cutoff":
        yield cutoff_source(plate, model=True)


_PAPERS_MATERIAL: Final[tuple[Origin, str]] = ("paper", "the paper's (section II-B)")
_SPRINGS: Final[tuple[Origin, str]] = (
    "assumed",
    "assumed by tactstrip: springs that give the measured cut-off",
)
_LOSSLESS: Final[tuple[Origin, str]] = ("assumed", "assumed by tactstrip: springs without loss")


def _loss(plate: Plate) -> Iterator[Source]:
    for key in ("loss_factor", "viscous_time_us"):
        value = getattr(plate, key)
        if value:
            yield source(f"strip.{key}", value, *YOURS)
    if not (plate.loss_factor or plate.viscous_time_us):
        from experiment.study.physics import ASSUMED_LOSS, LEAST_LOSS, MOST_LOSS

        words = (
            f"none is stated: plan and simulated people have {ASSUMED_LOSS:g} (assumed), the check "
            f"tries {LEAST_LOSS:g} and {MOST_LOSS:g} (assumed)"
        )
        if plate.length_mm == "endless":
            words = "none is stated: 0 on an endless plate"
        yield source("strip.loss_factor", plate.loss_factor, "assumed", words)


def cutoff_source(plate: Plate, *, model: bool = False) -> Source:
    """Return where a plate's measured cut-off is from; without one it is computed.

    Of the `model` it is computed, too, where a measured one is but compared with it.
    """
    key, value = "strip.measured_cutoff_hz", plate.measured_cutoff_hz
    if value is None or (model and plate.edge != "measured-cutoff"):
        words = f"computed from {plate.edge.replace('simply-', 'simply ')} edges"
        return source("strip.cutoff_hz", plate.strip.cutoff_hz(), "computed", words)
    papers = plate.is_the_papers and value == PAPER_CUTOFF_HZ and plate.measured_by is None
    if papers and stated(plate, "measured_cutoff_hz", by_value=False) is None:
        # uniform along the plate: its length does not enter the first cut-off
        at = "" if plate.is_as_measured else f", at length_mm = {PAPER_LENGTH_MM:g}"
        return source(key, value, "paper", f"measured by the paper (figure 4{at})")
    return source(key, value, "measured", _measured(plate))


def in_short(source: Source, one: Plate | Actuator) -> str:
    """Say in a few words who measured a value, or how well it is predicted: for titles and tables.

    >>> from experiment.study.files import paper_study
    >>> plate = paper_study().plate
    >>> in_short(cutoff_source(plate), plate)
    'measured by the paper'
    """
    if source.origin == "paper":
        return "measured by the paper"
    if source.origin == "measured":
        return f"measured by {one.measured_by}" if one.measured_by else "your measurement"
    if isinstance(one, Actuator) and one.alike:
        return f"assumed equal to the {one.alike} actuator's"
    return "predicted from layers, to a factor of two"


def _measured(one: Plate | Actuator) -> str:
    by, on = one.measured_by or "not stated", one.measured_on or "not stated"
    return f"measured (by: {by}; on: {on})"


def _is_the_papers(study: Study, actuator: Actuator) -> bool:
    """Tell whether an actuator is a disc of the paper on its plate, where it was."""
    placed = any(
        all(getattr(actuator, key) == value for key, value in disc.items())
        for disc in paper_actuators(measured=False)
    )
    on_centre_line = actuator.y_mm == study.plate.width_mm / 2
    alike = actuator.basis is None or actuator.is_the_papers
    return study.plate.is_the_papers and placed and on_centre_line and alike

"""What a refusal says would be right is right: every value it names is taken when it is applied."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import assume, example, given, reject, settings
from hypothesis import strategies as st

from experiment.study.sections.design import MAX_TRIALS, Design
from experiment.study.sections.plate import Plate
from experiment.study.sections.table import KeyRange
from experiment.study.study import Study
from experiment.terms.checks import in_mind, inward
from experiment.trial.draw import block_count
from experiment.trial.plan import PlanError

METALS = st.sampled_from(["aluminium", "steel", "glass", "pmma", "titanium"])
NUMBER = r"(-?[\d.]+(?:e[-+]?\d+)?)"


def refused(make: Any, **keys: Any) -> str:
    """Return what is refused of some keys; of what is taken nothing is to be shown."""
    try:
        make(**keys)
    except ValueError as error:
        return str(error)
    return reject()


def sig(value: float, digits: int) -> float:
    """Return a number as a person types it."""
    return float(f"{value:.{digits}g}")


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(
    width_mm=st.floats(2, 300).map(lambda mm: sig(mm, 3)),
    thickness_mm=st.floats(0.02, 10).map(lambda mm: sig(mm, 3)),
    material=METALS,
    cutoff_hz=st.floats(20, 100_000).map(lambda hz: sig(hz, 5)),
)
@example(width_mm=43.0, thickness_mm=1.54, material="steel", cutoff_hz=8566.0)
def test_the_plate_that_a_cutoff_fits_has_it(
    width_mm: float, thickness_mm: float, material: str, cutoff_hz: float
) -> None:
    assume(thickness_mm <= width_mm / 2)
    keys: dict[str, Any] = {
        "width_mm": width_mm,
        "length_mm": 200.0,
        "thickness_mm": thickness_mm,
        "material": material,
        "measured_cutoff_hz": cutoff_hz,
    }
    told = refused(Plate, **keys)
    fits = told.partition(" fits ")[2].partition(";")[0]
    sizes = dict(re.findall(rf"{NUMBER} mm of (thickness|width)", fits))
    assert fits, told
    for number, size in re.findall(rf"{NUMBER} mm of (thickness|width)", fits):
        Plate(**keys | {f"{size}_mm": float(number)})
    limits = re.findall(rf"{NUMBER} Hz", told.partition(";")[0])
    assert len(sizes) == len(re.findall("mm of", fits))
    for limit, factor in zip(map(float, limits), (1 + 1e-9, 1 - 1e-9), strict=True):
        if 20 <= limit <= 200_000:
            Plate(**keys | {"measured_cutoff_hz": limit * factor})


@given(trials=st.integers(1, MAX_TRIALS), fraction=st.floats(0.0, 0.9))
@example(trials=75, fraction=0.1)
@example(trials=2, fraction=0.1)
def test_a_fraction_is_rounded_to_whole_trials_or_the_two_nearest_are_named(
    trials: int, fraction: float
) -> None:
    def both_trials(value: float) -> int:
        return Design(trials_per_side=trials, both_fraction=value).both_trials

    try:
        found = both_trials(fraction)
    except ValueError as error:
        named = [float(text) for text in re.findall(rf"{NUMBER} \(\d+", str(error))]
        counts = [int(text) for text in re.findall(r" \((\d+)", str(error))]
        if "at most" in str(error):
            (most,) = re.findall(rf"at most {NUMBER},", str(error))
            assert both_trials(float(most)) <= MAX_TRIALS
            return
        assert [both_trials(value) for value in named] == counts
        assert counts[1] == counts[0] + 1
        assert named[0] < fraction < named[1]
    else:
        assert abs(found - 2 * trials * fraction / (1 - fraction)) <= 0.5 + 1e-6
        assert found / (2 * trials + found) == pytest.approx(fraction, rel=0.1)


@settings(deadline=None, max_examples=40)
@given(
    levels=st.integers(1, 6),
    repeats=st.integers(1, 10),
    both=st.integers(60, 120),
    blanks=st.integers(60, 120),
    break_every=st.integers(1, 14),
)
def test_the_shortest_blocks_that_are_named_can_be_had(
    levels: int, repeats: int, both: int, blanks: int, break_every: int
) -> None:
    design = Design(
        levels_vpp=tuple(10.0 + level for level in range(levels)),
        trials_per_side=levels * repeats,
        both_trials=both,
        blank_trials=blanks,
        responses=("left", "right", "both", "none"),
        order="balanced",
        break_every=break_every,
    )
    try:
        block_count(design)
    except PlanError as error:
        (shortest,) = re.findall(r"at least (\d+)", str(error))
        block_count(replace(design, break_every=int(shortest)))
    else:
        reject()


@settings(max_examples=40)
@given(levels=st.integers(2, 9), trials=st.integers(1, MAX_TRIALS))
def test_the_nearest_multiples_of_the_levels_are_named(levels: int, trials: int) -> None:
    keys: dict[str, Any] = {
        "levels_vpp": [10.0 + level for level in range(levels)],
        "order": "balanced",
    }
    told = refused(Design, trials_per_side=trials, **keys)
    named = re.findall(r"(\d+)", told.partition("; write ")[2])
    assert named
    for text in named:
        assert abs(int(text) - trials) < levels
        Design(trials_per_side=int(text), **keys)


@settings(max_examples=40)
@given(levels=st.integers(1, 9), repeats=st.integers(MAX_TRIALS // 2, MAX_TRIALS))
def test_as_many_repeats_as_are_named_are_taken(levels: int, repeats: int) -> None:
    keys: dict[str, Any] = {"levels_vpp": [10.0 + level for level in range(levels)]}
    told = refused(Design, repeats_per_level=repeats, **keys)
    (most,) = re.findall(r"at most (\d+) ", told)
    assert Design(repeats_per_level=int(most), **keys).trials_per_side <= MAX_TRIALS


def study(**sections: Any) -> Study:
    """Return a study of tables, as a file has them."""
    return Study(**sections)


def actuators(left: dict[str, Any], right: dict[str, Any]) -> list[dict[str, Any]]:
    disc = {"shape": "disc", "diameter_mm": 12.0}
    return [{"side": "left"} | disc | left, {"side": "right"} | disc | right]


STEEL = {"width_mm": 30.0, "thickness_mm": 0.5, "material": "steel", "edge": "clamped"}


@settings(deadline=None, max_examples=40)
@given(
    length_mm=st.floats(20, 5000),
    diameter_mm=st.floats(0.5, 60),
    x_mm=st.floats(0.001, 5000),
    y_mm=st.floats(0, 30),
    in_metres=st.booleans(),
)
def test_an_actuator_is_taken_where_a_refusal_puts_it(
    length_mm: float, diameter_mm: float, x_mm: float, y_mm: float, *, in_metres: bool
) -> None:
    sizes = {"diameter_mm": diameter_mm}
    places = {"x_mm": x_mm / (1e3 if in_metres else 1), "y_mm": y_mm}

    def put(**places: float) -> Study:
        left = sizes | places | {"x_mm": -places["x_mm"]}
        tables = actuators(left, sizes | places)
        return study(strip=STEEL | {"length_mm": length_mm}, actuator=tables)

    told = refused(put, **places)
    written = re.findall(rf"write ([xy]_mm) = {NUMBER}(?: and x_mm = {NUMBER})?", told)
    ranges = re.findall(rf"([xy]_mm) from {NUMBER} to {NUMBER}", told)
    for key, *values in written:
        value = abs(float(values[1] or values[0]))
        again = refusal_of(put, **places | {key: value})
        assert not again.startswith(re.split(r"-?\d", told)[0]), (told, again)
    for key, least, most in ranges:
        for value in (float(least), float(most)):
            if key == "x_mm" and value < sizes["diameter_mm"]:
                continue  # its twin on the other side would be in the way
            again = refusal_of(put, **places | {key: value})
            assert key not in again, (told, again)


def refusal_of(make: Any, **keys: Any) -> str:
    try:
        make(**keys)
    except ValueError as error:
        return str(error)
    return ""


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    x_mm=st.floats(3, 75),
    y_mm=st.floats(0.5, 29.5),
    finger_mm=st.floats(1, 50),
)
def test_a_finger_as_large_as_is_named_rests_on_the_plate(
    x_mm: float, y_mm: float, finger_mm: float
) -> None:
    def put(finger_mm: float) -> Study:
        place = {"diameter_mm": 1.0, "y_mm": y_mm, "finger_diameter_mm": finger_mm}
        load = {"mass_g": 0.3, "stiffness_n_m": 600.0, "damping_n_s_m": 1.0}
        return study(
            strip=STEEL | {"length_mm": 160.0},
            actuator=actuators(place | {"x_mm": -x_mm}, place | {"x_mm": x_mm}),
            finger_load=load | {"holds_up_to_hz": 800.0, "source": "a"},
        )

    told = refused(put, finger_mm=finger_mm)
    assert "finger_diameter_mm" in told
    for most in re.findall(rf"at most {NUMBER} ", told):
        put(float(most))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(ceiling_vpp=st.floats(0.1, 1000), level_vpp=st.floats(0.1, 1e4))
def test_a_level_at_the_ceiling_that_is_named_is_taken(
    ceiling_vpp: float, level_vpp: float
) -> None:
    def put(level_vpp: float) -> Study:
        return study(device={"ceiling_vpp": ceiling_vpp}, design={"levels_vpp": [level_vpp]})

    told = refused(put, level_vpp=level_vpp)
    (most,) = re.findall(rf"ceiling_vpp = {NUMBER};", told)
    put(float(most))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(um=st.floats(1e-4, 5000), at_vpp=st.floats(1e-3, 1000), vpp=st.floats(0.1, 200))
def test_a_displacement_in_the_range_that_is_named_is_taken(
    um: float, at_vpp: float, vpp: float
) -> None:
    def put(um: float) -> Study:
        measured = {"measured_displacement_um": um, "measured_at_vpp": at_vpp}
        left, right = actuators({"x_mm": -35.0}, {"x_mm": 35.0})
        return study(
            strip=STEEL | {"length_mm": 200.0},
            actuator=[left | measured | {"measured_at_hz": 300.0}, right],
            design={"levels_vpp": [vpp]},
            simulation={"threshold_vpp": 50.0},
        )

    told = refused(put, um=um)
    limits = re.findall(rf"[<>]= {NUMBER}", told)
    assert limits, told
    meant = re.findall(rf"write measured_displacement_um = {NUMBER}", told)
    for value in map(float, (*limits, *meant)):
        if 1e-4 <= value <= 5000:
            put(value)


@pytest.mark.slow
@given(
    value=st.floats(-1e6, 1e6).filter(bool),
    least=st.floats(-1e3, 1e3),
    most=st.floats(-1e3, 1e3),
    key=st.sampled_from(["width_mm", "youngs_modulus_gpa", "loss_factor", "level_dbfs", "a_s"]),
)
def test_a_number_in_another_unit_is_named_only_in_the_range(
    value: float, least: float, most: float, key: str
) -> None:
    limits = KeyRange(ge=min(least, most), le=max(least, most))
    assume(not limits.hold(value))
    told = in_mind(key, value, limits.hold)
    if told:
        assert limits.hold(float(told.rpartition(" ")[2])), told


@given(limit=st.floats(-1e12, 1e12), digits=st.integers(1, 15), upward=st.booleans())
def test_a_limit_is_rounded_to_the_side_of_what_it_allows(
    limit: float, digits: int, *, upward: bool
) -> None:
    told = inward(limit, least=upward, digits=digits)
    assert float(told) >= limit if upward else float(told) <= limit
    assert float(told) == pytest.approx(limit, rel=10.0 ** (1 - digits))

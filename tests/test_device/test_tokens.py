"""Tokens: what is forgotten is never taken for what never was."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device import Delivery, Outcome, Refusal
from device.core.tokens import Exchange, Record, TokenHistory, delivery
from device.wire.protocol import FATES


@settings(deadline=None, max_examples=80)
@given(
    tokens=st.lists(st.integers(1, 40), unique=True, max_size=30),
    capacity=st.integers(1, 10),
    asked=st.integers(1, 40),
)
def test_no_token_that_was_here_is_ever_said_to_be_new(
    tokens: list[int], capacity: int, asked: int
) -> None:
    history = TokenHistory(capacity)
    for token in tokens:
        history.keep(Record.not_fired(token, Refusal.EXPIRED))
    record = history.find(asked)
    if asked in tokens[-capacity:]:
        assert record == Record.not_fired(asked, Refusal.EXPIRED)
    else:
        assert record is None
        fate = history.absent(asked).fate
        assert fate in (FATES["unknown"], FATES["never_armed"])
        assert fate == FATES["unknown"] or asked not in tokens
    assert history.absent(max(tokens, default=0) + 1).fate == FATES["never_armed"]


def test_every_fate_has_an_outcome_and_only_certain_ones_are_not_fired() -> None:
    names: dict[Outcome, set[str]] = {outcome: set() for outcome in Outcome}
    for name, (outcome, _) in FATES.items():
        names[outcome].add(name)
    assert names[Outcome.FIRED] == {"fired"}
    assert names[Outcome.INDETERMINATE] == {"armed", "unknown"}
    assert len(set(FATES.values())) == len(FATES)


def reported(device_us: int, **facts: Any) -> Delivery:
    """Return what a driver reports when an exchange of 2 ms ended at that time of the device."""
    return delivery(
        Exchange(
            record=Record(token=9, **facts),
            boot_id=3,
            host_before_s=10.0,
            host_after_s=10.002,
            device_us=device_us,
            retries=2,
        ),
        channels=2,
    )


def test_what_fired_is_reported_with_onset_and_the_levels_that_were_set() -> None:
    report = reported(77, outcome=Outcome.FIRED, start_us=77, levels_mvpp=(64_100, 0))
    assert (report.outcome, report.device_us, report.boot_id, report.retries) == (
        Outcome.FIRED,
        77,
        3,
        2,
    )
    assert report.levels_vpp == (64.1, 0.0)
    assert (report.host_before_s, report.host_after_s) == (10.0, 10.002)
    assert report.uncertainty_s == pytest.approx(0.001)


def test_an_onset_asked_for_later_is_carried_back_with_more_uncertainty() -> None:
    report = reported(5_000_000, outcome=Outcome.FIRED, start_us=1_000_000)
    assert report.host_before_s == pytest.approx(6.0 - 4e-4, abs=1e-6)
    assert report.host_after_s == pytest.approx(6.002 + 4e-4, abs=1e-6)
    assert report.uncertainty_s == pytest.approx(0.001 + 4e-4)

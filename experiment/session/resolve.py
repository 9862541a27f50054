"""The trial in which a session was interrupted: what became of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from device.driver import Outcome
from experiment.record.entries import StimulusConfirmed, TrialEnded

if TYPE_CHECKING:
    from device.driver import BurstDevice, Identity
    from experiment.record.history import Presentation
    from experiment.record.journal import Journal
    from experiment.study.study import Study
    from experiment.trial.events import Status


def resolve_interrupted_trial(
    interrupted: Presentation,
    study: Study,
    journal: Journal,
    device: BurstDevice,
    identity: Identity,
) -> None:
    """Write the end of the trial in which the session was interrupted.

    If the answer was recorded, the trial counts, unless the study repeats trials with a premature
    response, or with a burst that was not verified, and this is one. Otherwise the trial is voided
    if a burst was played, and aborted if none was. It is indeterminate if the device restarted or
    does not know the outcome.
    """
    interval = interrupted.interval
    confirmed = interrupted.confirmed.get(interval)
    if confirmed is None:
        device.disarm(interrupted.token)
        delivery = device.query(interrupted.token)
        same_boot = interrupted.boot_id == identity.boot_id
        if delivery.outcome is Outcome.NOT_FIRED and not same_boot:
            delivery = replace(delivery, outcome=Outcome.INDETERMINATE)
        confirmed = StimulusConfirmed.from_delivery(interrupted.attempt, interval, delivery, None)
        journal.append(confirmed)
    response = interrupted.response
    premature = response is not None and response.premature
    repeated = premature and study.design.premature_responses == "repeat"
    refused = interrupted.is_mismatch and study.monitor.disagreement == "repeat"
    is_felt = any(line.outcome is Outcome.FIRED for line in interrupted.confirmed.values())
    status: Status
    if confirmed.outcome is Outcome.FIRED and not (refused and response is not None):
        status = "ok" if response is not None and not repeated else "voided"
    elif confirmed.outcome is Outcome.NOT_FIRED:
        status = "voided" if is_felt else "aborted"
    else:
        status = "indeterminate"
    end = TrialEnded(
        trial=interrupted.attempt.trial.number,
        attempt=interrupted.attempt.number,
        status=status,
        premature=premature,
        noise_ok=None if response is None else response.noise_ok,
    )
    journal.append(end, sync=True)

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

    An answer that was still written stands, unless it was premature, or its burst not verified,
    and the study repeats such trials. A stimulus that went out is voided, one that did not is
    aborted; where the device cannot tell, or was started anew, the trial is indeterminate.
    """
    confirmed = interrupted.confirmed
    if confirmed is None:
        device.disarm(interrupted.token)
        delivery = device.query(interrupted.token)
        same_boot = interrupted.boot_id == identity.boot_id
        if delivery.outcome is Outcome.NOT_FIRED and not same_boot:
            delivery = replace(delivery, outcome=Outcome.INDETERMINATE)
        confirmed = StimulusConfirmed.from_delivery(interrupted.attempt, delivery, None)
        journal.append(confirmed)
    response, measured = interrupted.response, interrupted.measured
    premature = response is not None and response.premature
    repeated = premature and study.design.premature_responses == "repeat"
    is_mismatch = measured is not None and measured.burst_verified == "false"
    refused = is_mismatch and study.monitor.disagreement == "repeat"
    status: Status
    if confirmed.outcome is Outcome.FIRED and not (refused and response is not None):
        status = "ok" if response is not None and not repeated else "voided"
    else:
        status = "aborted" if confirmed.outcome is Outcome.NOT_FIRED else "indeterminate"
    end = TrialEnded(
        trial=interrupted.attempt.trial.number,
        attempt=interrupted.attempt.number,
        status=status,
        premature=premature,
        noise_ok=None if response is None else response.noise_ok,
    )
    journal.append(end, sync=True)

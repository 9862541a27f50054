"""The trial in which a session was interrupted: what became of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from device.driver import Outcome
from experiment.session.setting import delivery_values, trial_name

if TYPE_CHECKING:
    from device.driver import BurstDevice, Identity
    from experiment.archive.history import InterruptedTrial
    from experiment.archive.journal import Journal
    from experiment.study.study import Study


def resolve_interrupted_trial(
    interrupted: InterruptedTrial,
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
    name = trial_name(interrupted.attempt)
    outcome = interrupted.outcome
    if outcome is None:
        device.disarm(interrupted.token)
        delivery = device.query(interrupted.token)
        same_boot = interrupted.boot_id == identity.boot_id
        if delivery.outcome is Outcome.NOT_FIRED and not same_boot:
            delivery = replace(delivery, outcome=Outcome.INDETERMINATE)
        journal.append("stimulus_confirmed", name | delivery_values(delivery, None))
        outcome = delivery.outcome
    repeated = interrupted.premature and study.design.premature_responses == "repeat"
    refused = interrupted.verified == "false" and study.monitor.disagreement == "repeat"
    if outcome == Outcome.FIRED and not (refused and interrupted.response is not None):
        status = "ok" if interrupted.response is not None and not repeated else "voided"
    else:
        status = "aborted" if outcome == Outcome.NOT_FIRED else "indeterminate"
    how = {"premature": interrupted.premature, "noise_ok": interrupted.noise_ok}
    journal.append("trial_end", name | {"status": status} | how, sync=True)

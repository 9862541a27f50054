"""The trial in which a session was interrupted: what became of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from device.driver import Outcome
from experiment.session.setting import delivery_facts, trial_name

if TYPE_CHECKING:
    from device.driver import BurstDevice
    from experiment.archive.history import OpenTrial
    from experiment.archive.journal import Journal
    from experiment.study.study import Study


def settle_open_trial(
    open_trial: OpenTrial, study: Study, journal: Journal, device: BurstDevice, *, same_boot: bool
) -> None:
    """Write the end of the trial in which the session was interrupted.

    An answer that was still written stands, unless it was anticipated, or its burst not verified,
    and the study repeats such trials. A stimulus that went out is voided, one that did not is
    aborted; where the device cannot tell, or was started anew, the trial is indeterminate.
    """
    name = trial_name(open_trial.task)
    outcome = open_trial.outcome
    if outcome is None:
        device.disarm(open_trial.token)
        delivery = device.query(open_trial.token)
        if delivery.outcome is Outcome.NOT_FIRED and not same_boot:
            delivery = replace(delivery, outcome=Outcome.INDETERMINATE)
        journal.append("stimulus_confirmed", name | delivery_facts(delivery, None))
        outcome = delivery.outcome
    again = open_trial.anticipated and study.design.anticipated == "requeue"
    refused = open_trial.verified == "false" and study.monitor.disagreement == "repeat"
    if outcome == Outcome.FIRED and not (refused and open_trial.response is not None):
        status = "ok" if open_trial.response is not None and not again else "voided"
    else:
        status = "aborted" if outcome == Outcome.NOT_FIRED else "indeterminate"
    end = {
        "status": status,
        "anticipated": open_trial.anticipated,
        "noise_ok": open_trial.noise_ok,
    }
    journal.append("trial_end", name | end, sync=True)

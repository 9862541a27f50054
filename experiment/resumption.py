"""Going on with an interrupted session: may it go on here and now, and what became of its trial."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from device.driver import Outcome
from experiment.archive import ArchiveError
from experiment.entries import delivery_facts, trial_name
from experiment.header import place

if TYPE_CHECKING:
    from device.driver import BurstDevice, Identity
    from experiment.conduct import Setting
    from experiment.journal import Journal
    from experiment.replay import History, OpenTrial
    from experiment.study import Study

LONGEST_INTERRUPTION_S = 30 * 60
"""After a longer one, plate, fingers and noise may not be what they were."""


def settle(
    open_trial: OpenTrial, study: Study, journal: Journal, device: BurstDevice, *, same_boot: bool
) -> None:
    """Write the end of the trial in which the session was interrupted.

    An answer that was still written stands, unless it was anticipated and the study repeats such
    trials. A stimulus that went out is voided, one that did not is aborted; where the device cannot
    tell, or was started anew, the trial is indeterminate.
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
    if outcome == Outcome.FIRED:
        status = "ok" if open_trial.response is not None and not again else "voided"
    else:
        status = "aborted" if outcome == Outcome.NOT_FIRED else "indeterminate"
    end = {
        "status": status,
        "anticipated": open_trial.anticipated,
        "noise_ok": open_trial.noise_ok,
    }
    journal.append("trial_end", name | end, sync=True)


def refuse_another_place(history: History, identity: Identity, setting: Setting) -> None:
    """Refuse another kind of participant; another place or time, unless the operator says so."""
    if setting.responder.simulated != history.opening["simulated"]:
        who = "a simulated participant" if history.opening["simulated"] else "a person"
        raise ArchiveError(
            f"the session was begun with {who} and can only go on so: give another --responder"
        )
    if setting.resume_anyway:
        return
    here = place(identity)
    for what in ("host", "device", "serial_number"):
        if here[what] != history.opening[what]:
            raise ArchiveError(
                f"the session was begun with {what} {history.opening[what]!r}; got {here[what]!r}: "
                "give --resume-anyway if that makes no difference"
            )
    gap_s = time.time() - history.last_wall_s
    if gap_s > LONGEST_INTERRUPTION_S:
        raise ArchiveError(
            f"the session was interrupted {gap_s / 60:.0f} minutes ago, the most is "
            f"{LONGEST_INTERRUPTION_S / 60:.0f}: give --resume-anyway if fingers, plate and noise "
            "are as they were"
        )

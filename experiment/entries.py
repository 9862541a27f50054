"""What the journal's lines say of a trial and its stimulus."""

from __future__ import annotations

from typing import TYPE_CHECKING

from device.driver import Outcome

if TYPE_CHECKING:
    from device.driver import Delivery, DeviceError
    from experiment.steps import Task


def trial_name(task: Task) -> dict[str, object]:
    """List how the journal names an attempt at a trial."""
    return {"trial": task.trial.number, "attempt": task.attempt}


def delivery_facts(delivery: Delivery, onset_s: float | None) -> dict[str, object]:
    """List what the journal keeps of a delivery; onset and levels only if it surely went out."""
    fired = delivery.outcome is Outcome.FIRED
    return {
        "outcome": delivery.outcome.value,
        "token": delivery.token,
        "boot_id": delivery.boot_id,
        "device_us": delivery.device_us,
        "onset_s": onset_s if fired else None,
        "uncertainty_s": delivery.uncertainty_s,
        "retries": delivery.retries,
        "level_left_vpp": delivery.level_left_vpp if fired else None,
        "level_right_vpp": delivery.level_right_vpp if fired else None,
    }


def fault_facts(error: DeviceError) -> dict[str, object]:
    """List what the journal keeps of a device's fault."""
    return {"error": type(error).__name__, "message": str(error)}

"""What a session's header and its first journal lines say of place, noise and stimuli."""

from __future__ import annotations

import platform
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from experiment.record import NOT_AVAILABLE
from experiment.stimulus import host_limits, stimulus_facts
from experiment.study_check import check_study

if TYPE_CHECKING:
    from device.driver import Identity
    from experiment.conduct import Setting
    from experiment.noise_player import NoiseFacts
    from experiment.plan import Plan
    from experiment.study import Study


def header(study: Study, plan: Plan, setting: Setting, identity: Identity) -> dict[str, Any]:
    """List what is worth knowing of a session and is not part of the plan."""
    check = check_study(study, plan.gains)
    accepted = [c.condition for c in check.conditions if c.verdict == "accepted"]
    return {
        "schema": 1,
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
        **opening(plan, identity, setting),
        **setting.sitting.header(study, plan),
        "device_identity": asdict(identity),
        "device_cannot": list(setting.device.cannot),
        "hardware_confirmed": _confirmed(setting, identity),
        "limits": asdict(host_limits(study.device)),
        "responses": plan.responses,
        **noise_facts(setting.noise.facts),
        "stimuli": {c.name: stimulus_facts(c) for c in study.conditions},
        "unfit_stimuli_accepted": {c.name: c.accept_unfit for c in accepted},
        "platform": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in ("tactstrip", "numpy")},
        "calibration": NOT_AVAILABLE,
    }


def opening(plan: Plan, identity: Identity, setting: Setting) -> dict[str, Any]:
    """List what a session's first journal line says."""
    return {
        "participant": plan.participant,
        "session": plan.session,
        "plan_sha256": plan.sha256,
        "simulated": setting.responder.simulated,
        **place(identity),
    }


def resuming(study: Study, plan: Plan, identity: Identity, setting: Setting) -> dict[str, Any]:
    """List what the first journal line of a later sitting says."""
    return {
        **place(identity),
        **setting.sitting.facts(study, plan),
        "hardware_confirmed": _confirmed(setting, identity),
        **noise_facts(setting.noise.facts),
    }


def place(identity: Identity) -> dict[str, Any]:
    """List on which host and device a session goes on."""
    return {
        "host": platform.node(),
        "device": identity.model,
        "serial_number": identity.serial_number,
        "boot_id": identity.boot_id,
    }


def noise_facts(facts: NoiseFacts) -> dict[str, Any]:
    """List what is kept of the masking noise; what is not known, or does not apply, is ``n/a``.

    Examples
    --------
    >>> from experiment.noise_player import NoiseFacts
    >>> kept = noise_facts(NoiseFacts(noise="none", played=False))
    >>> kept["masking_noise_played"], kept["noise_level_dba"]
    (False, 'n/a')
    """
    return {
        "masking_noise": facts.noise,
        "masking_noise_played": facts.played,
        "noise_level_dba": _or_not(facts.measured_level_dba),
        "noise_max_level_dba": _or_not(facts.max_level_dba),
        "noise_sha256": _or_not(facts.sha256),
        "noise_sample_rate_hz": _or_not(facts.sample_rate_hz),
        "noise_loop_s": _or_not(facts.loop_s),
        "noise_sound_card": _or_not(facts.sound_card),
    }


def _or_not(value: float | str | None) -> float | str:
    return NOT_AVAILABLE if value is None else value


def _confirmed(setting: Setting, identity: Identity) -> dict[str, Any] | str:
    """Return the word that a real device is safe; one given for an emulator says nothing."""
    if setting.confirmation is None or identity.emulated:
        return NOT_AVAILABLE
    return setting.confirmation.facts

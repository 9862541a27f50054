"""What header.json and the journal's lines keep of a visit: computer, device, people and noise."""

from __future__ import annotations

import platform
from dataclasses import asdict
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from device.clock import boot
from experiment.check.check import check_study
from experiment.hardware.monitor import monitor_facts
from experiment.hardware.safety import device_kind
from experiment.hardware.setup import host_limits, line_settings, read_health, read_limits
from experiment.names import NOT_AVAILABLE
from experiment.record.entries import HostAndDevice, VisitConditions
from experiment.study.key_names import UNTYPED
from experiment.study.stimulus import stimulus_values
from experiment.trial.plan import HANDS_OFF

if TYPE_CHECKING:
    from device.driver import Identity
    from experiment.hardware.safety import Purpose
    from experiment.session.config import SessionConfig
    from experiment.study.study import Study
    from experiment.trial.plan import Plan
    from experiment.trial.responder import Responder


def header(study: Study, plan: Plan, config: SessionConfig, identity: Identity) -> dict[str, Any]:
    """Return the contents of header.json: what is worth knowing and is not part of the plan.

    A value that is not known, or does not apply, is ``n/a``.
    """
    is_simulated = config.responder_name == "simulated"
    contents = {
        "schema": 1,
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
        "participant": plan.participant,
        "session": plan.session,
        "plan_sha256": plan.sha256,
        "simulated": config.responder.simulated,
        **visit_conditions(study, plan, config, identity).model_dump(),
        "consent_version": study.about.consent_version or None,
        "screen": study.screen.model_dump() if config.responder_name == "screen" else None,
        "texts": None if is_simulated else study.texts.model_dump(by_alias=True),
        "device_identity": asdict(identity),
        "device_line": asdict(line_settings(study.device)),
        "device_cannot": list(config.device.cannot),
        "markers": config.markers and config.markers.description,
        "monitor": monitor_facts(config.monitor),
        "limits": asdict(host_limits(study.device)),
        "responses": plan.responses,
        "participant_number": plan.participant_number,
        "condition_order": plan.condition_order,
        "stimuli": {c.name: stimulus_values(c) for c in study.conditions},
        "accepted_violations": _accepted_violations(study, has_gains=bool(plan.gains)),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in ("tactstrip", "numpy")},
        "contact": study.contact.model_dump() | {"summary": study.contact.summary},
    }
    return {key: NOT_AVAILABLE if value is None else value for key, value in contents.items()}


def drawn_observer(responder: Responder) -> dict[str, Any] | None:
    """Return what was drawn for a simulated participant; None for anybody else.

    An installed simulated responder has no such values.
    """
    observer = getattr(responder, "observer_facts", None) if responder.simulated else None
    return observer if isinstance(observer, dict) else None


def host_and_device(identity: Identity, purpose: Purpose) -> HostAndDevice:
    """Return the computer and the device of a visit."""
    return HostAndDevice(
        host=platform.node(),
        host_boot=boot(),
        device=identity.model,
        device_kind=device_kind(identity, purpose),
        serial_number=identity.serial_number,
        boot_id=identity.boot_id,
    )


def visit_conditions(
    study: Study, plan: Plan, config: SessionConfig, identity: Identity
) -> VisitConditions:
    """Return everything about a visit that can differ from the visit before."""
    limits, health = read_limits(config.device), read_health(config.device)
    # An emulator needs no confirmation, so that one that was given is not recorded.
    confirmation = None if identity.emulated else config.confirmation
    masking, is_played = study.masking, config.noise.sha256 is not None
    return VisitConditions(
        **host_and_device(identity, config.purpose).model_dump(),
        operator=config.operator,
        responder=config.responder_name,
        responder_distribution=config.responder_from,
        driver_distribution=config.driver_from,
        response_mapping=_response_mapping(config.responder_name, study, plan),
        device_limits=None if limits is None else asdict(limits),
        device_health=None if health is None else asdict(health),
        hardware_confirmed=None if confirmation is None else asdict(confirmation),
        masking_noise=masking.noise,
        masking_noise_played=is_played,
        noise_level_dba=masking.measured_level_dba if is_played else None,
        noise_max_level_dba=masking.max_level_dba if is_played else None,
        noise_sha256=config.noise.sha256,
        noise_sample_rate_hz=masking.sample_rate_hz if is_played else None,
        noise_loop_s=masking.loop_s if is_played else None,
        noise_sound_card=(masking.sound_card or "default") if is_played else None,
    )


def _response_mapping(responder: str, study: Study, plan: Plan) -> dict[str, list[str]] | None:
    """Return the keys of pause and continue, and of every answer accepted in some trial.

    The keys of an installed responder are not known.
    """
    if responder not in {"screen", "terminal"}:
        return None
    untyped = UNTYPED if responder == "terminal" else frozenset()
    hands_off = any(trial.kind == HANDS_OFF for trial in plan.trials)
    accepted = study.task.offered(plan.responses, hands_off=hands_off)
    return {
        meaning: [name for name in names if name not in untyped]
        for meaning, names in study.keys.meanings.items()
        if meaning in accepted or meaning not in study.task.answer_names
    }


# The gains in a plan are those of one loss factor, without an uncertainty: what was accepted for
# the largest loss, or for unknown patches, shows only if everything is computed. That is done once
# for a study, which may have a hundred simulated sessions, and only if it states a reason.
@lru_cache(maxsize=1)
def _accepted_violations(study: Study, *, has_gains: bool) -> dict[str, str | None]:
    """Return the study's reason for each condition whose burst violates a limit."""
    if all(condition.accept_violation is None for condition in study.conditions):
        return {}
    check = check_study(study) if has_gains else check_study(study, ())
    accepted = (c.condition for c in check.conditions if c.verdict == "accepted")
    return {condition.name: condition.accept_violation for condition in accepted}

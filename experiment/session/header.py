"""What header.json and the journal's lines keep of a visit: computer, device, people and noise."""

from __future__ import annotations

import platform
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from device.clock import boot
from experiment.hardware.monitor import describe_monitor
from experiment.hardware.safety import device_kind
from experiment.hardware.setup import read_health, read_limits
from experiment.record.entries import Header, HostAndDevice, VisitConditions

if TYPE_CHECKING:
    from device.driver import Identity
    from experiment.hardware.safety import Purpose
    from experiment.session.config import SessionConfig
    from experiment.study.study import Study
    from experiment.trial.plan import Plan
    from experiment.trial.responder import Responder


def header(study: Study, plan: Plan, config: SessionConfig, identity: Identity) -> Header:
    """Return the contents of header.json."""
    monitor = config.monitor
    return Header(
        **visit_conditions(config, identity).model_dump(),
        participant=plan.participant,
        session=plan.session,
        begun=datetime.now(UTC).isoformat(timespec="seconds"),
        plan_sha256=plan.sha256,
        simulated=config.responder.simulated,
        consent_version=study.about.consent_version,
        device_identity=asdict(identity),
        device_cannot=list(config.device.cannot),
        monitor=None if monitor is None else describe_monitor(monitor),
        markers=None if config.markers is None else config.markers.description,
        platform=platform.platform(),
        versions={
            "python": platform.python_version(),
            **{name: version(name) for name in ("tactstrip", "numpy")},
        },
    )


def drawn_observer(responder: Responder) -> dict[str, Any] | None:
    """Return what was drawn for a simulated participant; None for anybody else.

    An installed simulated responder has no such values.
    """
    observer = getattr(responder, "observer_values", None) if responder.simulated else None
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


def visit_conditions(config: SessionConfig, identity: Identity) -> VisitConditions:
    """Return everything about a visit that can differ from the visit before."""
    limits, health = read_limits(config.device), read_health(config.device)
    # An emulator needs no confirmation, so that one that was given is not recorded.
    confirmation = None if identity.emulated else config.confirmation
    return VisitConditions(
        **host_and_device(identity, config.purpose).model_dump(),
        operator=config.operator,
        responder=config.responder_name,
        responder_distribution=config.responder_from,
        driver_distribution=config.driver_from,
        device_limits=None if limits is None else asdict(limits),
        device_health=None if health is None else asdict(health),
        hardware_confirmed=None if confirmation is None else asdict(confirmation),
        masking_noise_played=config.noise.sha256 is not None,
        noise_sha256=config.noise.sha256,
    )

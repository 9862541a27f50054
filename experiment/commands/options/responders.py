"""The responder of a session by its name: built in, simulated, or installed."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

from device.printing import echo
from experiment.exits import CommandError
from experiment.trial.responder import RESPONDERS, SessionPart

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import click

    from device.clock import Clock
    from experiment.operator.requests import Requests, Status, StopSignal
    from experiment.participant.settings import ResponderSettings
    from experiment.study.study import Study
    from experiment.trial.plan import Plan
    from experiment.trial.responder import Responder


def require_usable(responder: str) -> str | None:
    """Refuse a responder that cannot be used here; return the distribution of an installed one."""
    from experiment.participant.settings import installed_responder
    from experiment.participant.window import require_window

    if responder == "screen":
        require_window()
    if responder in RESPONDERS:
        return None
    try:
        return installed_responder(responder).distribution
    except ValueError as error:
        raise CommandError(f"--responder {error}") from error


@contextlib.contextmanager
def responder_named(
    name: str,
    study: Study,
    plan: Plan,
    clock: Clock,
    *,
    requests: Requests,
    stop: StopSignal,
    practice: bool = False,
) -> Iterator[Responder]:
    """Create a responder and, if it is a context manager, enter it.

    `practice` is practice without a device, where nothing moves.
    """
    if name == "simulated":
        from experiment.session.simulate import simulated_responder

        yield simulated_responder(study, plan, clock)
        return
    if practice:
        echo("Note: practice without a device gives no feedback and plays no masking noise.")
    from experiment.participant.settings import ResponderSettings, texts_without_device
    from experiment.trial.events import Attempt

    settings = ResponderSettings(
        responses=plan.responses,
        screen=study.screen,
        keys=study.keys,
        texts=texts_without_device(study.texts) if practice else study.texts,
        parts=frozenset(Attempt(trial, 1).part for trial in plan.trials) | {SessionPart.WARM_UP},
        requests=requests,
        stop=stop,
        task=study.task,
    )
    responder = _make_responder(name, settings, clock)
    with contextlib.ExitStack() as stack:
        if hasattr(responder, "__enter__"):
            responder = _enter_responder(name, responder, stack)
        yield responder


def _enter_responder(name: str, responder: Any, stack: contextlib.ExitStack) -> Responder:
    """Enter a responder; an installed one may fail or return another object."""
    from device.installed import require_instance
    from experiment.trial.responder import Responder

    entered: Responder
    if name in RESPONDERS:
        entered = stack.enter_context(responder)
        return entered

    def leave(*exception: Any) -> bool | None:
        # The session is over and its record closed, so an error here is printed, not raised.
        try:
            suppressed: bool | None = responder.__exit__(*exception)
        except (Exception, SystemExit) as error:  # noqa: BLE001 (whatever a lab's code raises)
            message = f"{type(error).__name__}: {' '.join(str(error).split())}"
            echo(f"--responder {name} failed as it was left: {message}", err=True)
            return False
        return suppressed

    try:
        entered = responder.__enter__()
        stack.push(leave)
        require_instance(entered, Responder)
    except Exception as error:
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        message = " ".join(f"{kind}{error}".split())
        raise CommandError(f"--responder {name}: {message}") from error
    return entered


def _make_responder(name: str, settings: ResponderSettings, clock: Clock) -> Any:
    """Create a responder that is not simulated."""
    if name == "screen":
        from experiment.participant.screen import ScreenResponder

        return ScreenResponder(settings, clock)
    if name == "terminal":
        from experiment.participant.terminal import TerminalResponder

        return TerminalResponder(settings, clock)
    from experiment.participant.settings import installed_responder
    from experiment.trial.responder import Responder

    try:
        return installed_responder(name).make(settings, clock, Responder)
    except ValueError as error:
        raise CommandError(f"--responder {error}") from error


@contextlib.contextmanager
def display_beside(
    name: str, requests: Requests, stop: StopSignal
) -> Iterator[tuple[Callable[[Status], object], Callable[[str], object]]]:
    """Yield a function that shows a status to the operator, and one that prints a line above it.

    If the participant uses the terminal, no status is shown, and a line begins below the open one.
    """
    if name == "terminal":
        yield lambda _: None, lambda line: echo("", line)
    else:
        from experiment.operator.view import OperatorView

        with OperatorView(requests, stop) as view:
            yield view.show, view.print


def complete_responders(_: click.Context, __: click.Parameter, typed: str) -> list[str]:
    """Complete the name of a built-in or installed responder."""
    from device.installed import RESPONDERS as GROUP
    from device.installed import installed

    return [name for name in (*RESPONDERS, *installed(GROUP)) if name.startswith(typed)]

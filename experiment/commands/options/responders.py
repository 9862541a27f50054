"""Who answers in a session, by name: a person, nobody, or a responder of a lab's own."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import click

from experiment.terms.exits import CommandError
from experiment.terms.responder import RESPONDERS, SessionPart

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.clock import Clock
    from experiment.operator.requests import Display, Requests, StopSignal
    from experiment.participant.settings import ResponderSettings
    from experiment.study.study import Study
    from experiment.terms.responder import Responder
    from experiment.trial.plan import Plan


def distribution_of(responder: str) -> str | None:
    """Return which distribution a responder of a lab's own is of."""
    from experiment.participant.settings import own_responder

    if responder in RESPONDERS:
        return None
    try:
        return own_responder(responder).distribution
    except ValueError as error:
        raise CommandError(f"--responder {error}") from error


def _tell_of_practice(study: Study) -> None:
    """Say what a person who practises without a device does not get."""
    told = ["no answer is called right or wrong"] * (study.design.practice_trials > 0)
    told += ["no masking noise is played"] * (study.masking.noise != "none")
    if told:
        click.echo(f"Note: practice without a device: {', and '.join(told)}.")


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
    """Make a responder and, if it is a context manager, enter it.

    In `practice` without a device nothing moves.
    """
    if name == "simulated":
        from experiment.session.simulate import simulated_responder

        yield simulated_responder(study, plan, clock)
        return
    if practice:
        _tell_of_practice(study)
    from experiment.participant.settings import ResponderSettings, texts_without_device
    from experiment.trial.events import Task

    settings = ResponderSettings(
        responses=plan.responses,
        screen=study.screen,
        keys=study.keys,
        texts=texts_without_device(study.shown_texts) if practice else study.shown_texts,
        parts=frozenset(Task(trial, 1).part for trial in plan.trials) | {SessionPart.WARM_UP},
        requests=requests,
        stop=stop,
    )
    someone = _made(name, settings, clock)
    if hasattr(someone, "__enter__"):
        with contextlib.ExitStack() as stack:
            yield _entered(name, someone, stack)
    else:
        yield someone


def _entered(name: str, someone: Any, stack: contextlib.ExitStack) -> Responder:
    """Enter a responder; one of a lab's own may fail there, or be another object then."""
    from device.installed import require_whole
    from experiment.terms.responder import Responder

    if name in RESPONDERS:
        entered: Responder = stack.enter_context(someone)
        return entered

    def left(*raised: Any) -> bool | None:
        # The session is over by then, and its record closed: what fails here is told, no more.
        try:
            ended: bool | None = someone.__exit__(*raised)
        except (Exception, SystemExit) as error:  # noqa: BLE001 (whatever a lab's code raises)
            said = f"{type(error).__name__}: {' '.join(str(error).split())}"
            click.echo(f"--responder {name} failed as it was left: {said}", err=True)
            return False
        return ended

    try:
        entered = someone.__enter__()
        stack.push(left)
        require_whole(entered, Responder)
    except Exception as error:
        said = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        raise CommandError(f"--responder {name}: {' '.join(said.split())}") from error
    return entered


def _made(name: str, settings: ResponderSettings, clock: Clock) -> Any:
    """Make a responder that is not simulated."""
    if name == "screen":
        from experiment.participant.screen import ScreenResponder

        return ScreenResponder(settings, clock)
    if name == "terminal":
        from experiment.participant.terminal import TerminalResponder

        return TerminalResponder(settings, clock)
    from experiment.participant.settings import own_responder
    from experiment.terms.responder import Responder

    try:
        return own_responder(name).make(settings, clock, Responder)
    except ValueError as error:
        raise CommandError(f"--responder {error}") from error


@contextlib.contextmanager
def display_beside(name: str, requests: Requests, stop: StopSignal) -> Iterator[Display]:
    """Show the operator how it goes, unless the terminal is the participant's."""
    if name == "terminal":
        from experiment.session.setting import NobodyLooks

        yield NobodyLooks()
    else:
        from experiment.operator.view import OperatorView

        with OperatorView(requests, stop) as view:
            yield view

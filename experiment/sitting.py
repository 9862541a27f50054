"""Who is at a session beside the plate, and with which keys: what its header keeps of them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

from experiment.checks import is_line, require_word
from experiment.record import ANSWERS, NOT_AVAILABLE

if TYPE_CHECKING:
    from experiment.plan import Plan
    from experiment.study import Study

ResponderName = Literal["screen", "terminal", "simulated"]
RESPONDERS: Final[tuple[ResponderName, ...]] = get_args(ResponderName)
"""Who can answer, by name on the command line."""
LONGEST_NAME: Final = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Sitting:
    """Who answers in a sitting, and who watches over it.

    Attributes
    ----------
    responder : str
        A word of `RESPONDERS`.
    operator : str or None
        The operator's name or sign, where it was given.

    Raises
    ------
    ValueError
        If the responder is unknown, or the operator's name is no short line of text.

    Examples
    --------
    >>> Sitting(operator=" ")
    Traceback (most recent call last):
    ValueError: operator must be a name in one line of text, of at most 100 characters; got ' '
    """

    responder: ResponderName = "simulated"
    operator: str | None = None

    def __post_init__(self) -> None:
        require_word("responder", self.responder, RESPONDERS)
        name = self.operator
        if name is not None and not (is_line(name) and len(name) <= LONGEST_NAME):
            raise ValueError(
                "operator must be a name in one line of text, of at most "
                f"{LONGEST_NAME} characters; got {name!r}"
            )

    def facts(self, study: Study, plan: Plan) -> dict[str, Any]:
        """List what may be another one whenever a session goes on: people and keys."""
        return {
            "operator": NOT_AVAILABLE if self.operator is None else self.operator,
            "responder": self.responder,
            "response_mapping": _mapping(self.responder, study, plan) or NOT_AVAILABLE,
        }

    def header(self, study: Study, plan: Plan) -> dict[str, Any]:
        """List what a header keeps: the sitting, the consent form, what was shown."""
        shown = self.responder == "screen"
        return {
            **self.facts(study, plan),
            "consent_version": study.consent_version or NOT_AVAILABLE,
            "screen": asdict(study.screen) if shown else NOT_AVAILABLE,
            "texts": asdict(study.texts) if shown else NOT_AVAILABLE,
        }


def _mapping(responder: ResponderName, study: Study, plan: Plan) -> dict[str, list[str]]:
    """Return the keys of every answer that is accepted in some trial, and of the wishes."""
    from experiment.plan import CONTROL

    if responder == "simulated":
        return {}
    if responder == "terminal":
        from experiment.terminal import KEY_NAMES

        keys = {meaning: words.split(" or ") for meaning, words in KEY_NAMES.items()}
    else:
        keys = {meaning: list(names) for meaning, names in asdict(study.keys).items()}
    accepted = {*plan.responses}
    if any(trial.kind == CONTROL for trial in plan.trials):
        accepted.add("none")
    return {
        meaning: names
        for meaning, names in keys.items()
        if meaning not in ANSWERS or meaning in accepted
    }

"""What a task is: what is presented, what may be answered, and which answer is correct."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    Floats: TypeAlias = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Presentation:
    """What one trial may present: the word of the column ``side``, and the driven sites."""

    name: str
    kind: str  # the word of the column ``kind`` in trials that count
    sites: tuple[str, ...]  # none in a blank trial
    correct: str  # the answer that names it
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """One answer, its default keys, and the sites that its picture highlights."""

    name: str
    keys: tuple[str, ...]
    sites: tuple[str, ...]
    meaning: str


class Guessing(NamedTuple):
    """How participants answer where nothing decides: probabilities, shape (participants, 1)."""

    false_alarm: Floats  # a guess, though nothing was detected and that could be answered
    first_site: Floats  # the first site, in a guess between sites
    all_sites: Floats  # every site at once, in a guess where that may be answered


class Decision(Protocol):
    """The probability of each answer of participants who never lapse."""

    def __call__(
        self,
        detected: Sequence[Floats],
        amplitudes: Sequence[Floats],
        responses: tuple[str, ...],
        guessing: Guessing,
    ) -> dict[str, Floats]:
        """Return it by answer; `detected` has the detection probability of each site."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A task: the only place that knows what its sites and answers are called.

    Attributes
    ----------
    name : str
        The task's name.
    sites : tuple of str
        The places that a stimulus may be presented at, from left to right.
    presentations : tuple of Presentation
        What a trial may present; the order is that of the device's slots.
    answers : tuple of Answer
        What may be answered; a study offers some of them.
    nothing : str
        The answer that no stimulus was noticed.
    kinds : mapping of str to str
        The words of the column ``kind`` of trials that count, and what they mean.
    reversed_mapping : mapping of str to str
        What a participant answers who confuses the keys.
    texts : mapping of str to str
        Default texts of ``[texts]`` that speak of sites and answers.
    instructions : mapping of frozenset to str
        Default instructions, by the answers that are offered beside the sites.
    decide : Decision
        The decision rule of a simulated participant in closed form.
    """

    name: str
    sites: tuple[str, ...]
    presentations: tuple[Presentation, ...]
    answers: tuple[Answer, ...]
    nothing: str
    kinds: Mapping[str, str]
    reversed_mapping: Mapping[str, str]
    texts: Mapping[str, str]
    instructions: Mapping[frozenset[str], str]
    decide: Decision

    @property
    def presentation_names(self) -> tuple[str, ...]:
        """The words of the column ``side``."""
        return tuple(presentation.name for presentation in self.presentations)

    @property
    def answer_names(self) -> tuple[str, ...]:
        """The words of the column ``response``, without time-outs."""
        return tuple(answer.name for answer in self.answers)

    @property
    def named_answers(self) -> tuple[str, ...]:
        """The answers that name a site."""
        return tuple(answer.name for answer in self.answers if answer.sites)

    @property
    def keys(self) -> dict[str, tuple[str, ...]]:
        """The default keys of each answer."""
        return {answer.name: answer.keys for answer in self.answers}

    def presentation(self, name: str) -> Presentation:
        """Return a presentation by its name."""
        return next(p for p in self.presentations if p.name == name)

    def of_kind(self, kind: str) -> tuple[Presentation, ...]:
        """Return the presentations of a kind."""
        return tuple(p for p in self.presentations if p.kind == kind)

    def offered(self, responses: tuple[str, ...], *, hands_off: bool) -> tuple[str, ...]:
        """Return the answers that count: with the hands off, `nothing` always does."""
        return tuple(dict.fromkeys((*responses, self.nothing))) if hands_off else responses

    def is_correct(self, presentation: str, response: str | None) -> bool | None:
        """Return whether an answer names what was presented; None without an answer."""
        return None if response is None else response == self.presentation(presentation).correct

    def is_detected(self, presentation: str, response: str) -> bool:
        """Return whether a trial counts as detected; of a blank trial, as a false alarm."""
        if self.presentation(presentation).sites:
            return response == self.presentation(presentation).correct
        return response in self.answer_names and response != self.nothing

    def guess_rate(self, responses: tuple[str, ...]) -> float | None:
        """Return the guess rate of a forced choice; None where blank trials estimate it."""
        return None if self.nothing in responses else 1 / len(responses)

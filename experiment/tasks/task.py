"""What a task is: what is presented, what may be answered, and which answer is correct."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations
from typing import (
    TYPE_CHECKING,
    Any,
    Final,
    Literal,
    NamedTuple,
    Protocol,
    TypeAlias,
    get_args,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    Floats: TypeAlias = NDArray[Any]

SINGLE: Final = "single"
"""The kind of trials that measure a threshold; a rule may choose their levels."""
BOTH: Final = "both"
"""The kind of trials with stimuli at several sites at once."""
BLANK: Final = "blank"
"""The kind of trials that measure how often participants guess."""

_RESERVED: Final = frozenset({"timeout", "invalid", "pause", "continue", "escape"})
PLACEMENT: Final = (
    "Place one finger of each hand on the plate, one above each actuator, and keep them there."
)
"""What left-right-both says before the first trial."""
FINGERS: Final = "Place a finger on the plate above each actuator, and keep it there."
"""What tasks at any number of sites say."""
_TEXTS: Final = frozenset(
    {"placement", "hands_off_before", "hands_off_after", "prompt", "prompt_hands_off"}
)
Scoring: TypeAlias = Literal[
    "localisation", "yes-no", "forced-choice", "discrimination", "identification"
]


class Burst(NamedTuple):
    """What one observation interval presents.

    Attributes
    ----------
    sites : tuple of str
        The sites that are driven; none in a silent interval.
    is_reference : bool
        Whether the burst has the study's reference level in place of the level of the trial.

    Examples
    --------
    >>> Burst(("thumb",)), Burst().sites
    (Burst(sites=('thumb',), is_reference=False), ())
    """

    sites: tuple[str, ...] = ()
    is_reference: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Presentation:
    """What one trial may present.

    Attributes
    ----------
    name : str
        The word of the column ``side``.
    kind : str
        The word of the column ``kind`` in trials that count.
    bursts : tuple of Burst
        One for each observation interval, in their order.
    correct : str
        The correct answer; in a comparison, the one for a level above the reference.
    correct_below : str or None
        In a comparison, the correct answer for a level below the reference.
    site : str or None
        The site whose threshold a trial measures; None if it measures no threshold.
    meaning : str
        Description in the documentation of data.

    Examples
    --------
    A burst at the thumb in the second of two intervals:

    >>> shown = Presentation(name="thumb_2", kind="single", bursts=(Burst(), Burst(("thumb",))),
    ...                      correct="second", site="thumb", meaning="thumb, second interval")
    >>> shown.sites, shown.interval
    (('thumb',), 1)
    """

    name: str
    kind: str
    bursts: tuple[Burst, ...]
    correct: str
    correct_below: str | None = None
    site: str | None = None
    meaning: str

    @property
    def sites(self) -> tuple[str, ...]:
        """The sites that get the level of the trial, in any interval."""
        return tuple(
            dict.fromkeys(
                site for burst in self.bursts if not burst.is_reference for site in burst.sites
            )
        )

    @property
    def interval(self) -> int:
        """The position of the burst that is measured: with the trial's level at `site`.

        Where no threshold is measured, it is that of the first burst with the trial's level, else
        of the last.
        """
        levels = [
            i for i, burst in enumerate(self.bursts) if burst.sites and not burst.is_reference
        ]
        at_site = (i for i in levels if self.site in {None, *self.bursts[i].sites})
        return next(at_site, len(self.bursts) - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """One answer.

    Attributes
    ----------
    name : str
        The word of the column ``response``.
    keys : tuple of str
        Its default keys.
    meaning : str
        Description in the documentation of data.
    sites : tuple of str
        The sites that it names, which its picture highlights.
    sign : str
        Sign that replaces the picture of plate and fingers, in any language.
    optional : bool
        Whether it is offered only if trials of the study need it, or if the study names it.

    Examples
    --------
    >>> Answer(name="yes", keys=("y",), meaning="something was felt").sites
    ()
    """

    name: str
    keys: tuple[str, ...]
    meaning: str
    sites: tuple[str, ...] = ()
    sign: str = ""
    optional: bool = False


class Sensation(NamedTuple):
    """What a burst does to simulated participants; each value by site, (participants, stimuli).

    Attributes
    ----------
    detected : sequence of array
        The probability of detection.
    amplitudes : sequence of array
        What the fingers get, in any unit.
    strengths : sequence of array
        log10(amplitude / threshold), divided by the width sigma of the psychometric function; -inf
        where nothing is presented.

    Examples
    --------
    A burst at the left finger's threshold, and nothing at the right finger:

    >>> import numpy as np
    >>> values = ([0.5, 0.0], [2.6, 0.0], [0.0, -np.inf])
    >>> felt = Sensation(*([np.array([[each]]) for each in of_sites] for of_sites in values))
    >>> felt.detected[0].item()
    0.5
    """

    detected: Sequence[Floats]
    amplitudes: Sequence[Floats]
    strengths: Sequence[Floats]


class Guessing(NamedTuple):
    """How participants answer where nothing decides: probabilities, shape (participants, 1).

    Attributes
    ----------
    false_alarm : array
        Of a guess, though nothing was detected and that could be answered.
    first_site : array
        Of the first site, in a guess between sites.
    all_sites : array
        Of every site at once, in a guess where that may be answered.

    Examples
    --------
    >>> import numpy as np
    >>> Guessing(*np.zeros((3, 1, 1))).false_alarm.item()
    0.0
    """

    false_alarm: Floats
    first_site: Floats
    all_sites: Floats


class Decision(Protocol):
    """The probability of each answer of participants who never lapse."""

    def __call__(
        self, intervals: Sequence[Sensation], responses: tuple[str, ...], guessing: Guessing, /
    ) -> dict[str, Floats]:
        """Return it by answer, for the sensation in each observation interval."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A task: the only place that knows what its sites and answers are called.

    Attributes
    ----------
    name : str
        The value of ``task.kind``.
    sites : tuple of str
        The places that a stimulus may be presented at, from left to right.
    presentations : tuple of Presentation
        What a trial may present; all have the same number of observation intervals.
    answers : tuple of Answer
        What may be answered.
    scoring : str
        What the analysis counts: ``localisation`` (the answer names the sites), ``yes-no`` (the
        guess rate is that of blank trials), ``forced-choice`` (it is one in the number of answers)
        ``discrimination`` (the comparison was stronger than the reference), or
        ``identification`` (a forced choice of the site; its information transfer is estimated).
    nothing : str or None
        The answer that no stimulus was noticed; none in a forced choice.
    kinds : mapping of str to str
        The words of the column ``kind`` of trials that count, and what they mean.
    reversed_mapping : mapping of str to str
        What a participant answers who confuses the keys.
    texts : mapping of str to str
        Default texts of ``[texts]`` that speak of sites and answers.
    instructions : mapping of frozenset to str
        Default instructions, by the optional answers that are offered.
    decide : Decision
        The decision rule of a simulated participant in closed form.
    reference_vpp : float or None
        The level of bursts that are a reference, peak-to-peak volts.

    Raises
    ------
    ValueError
        If presentations and answers contradict each other.

    Examples
    --------
    >>> from experiment import paper_study
    >>> task = paper_study().task
    >>> task.name, task.sites, task.n_intervals
    ('left-right-both', ('left', 'right'), 1)
    """

    name: str
    sites: tuple[str, ...]
    presentations: tuple[Presentation, ...]
    answers: tuple[Answer, ...]
    scoring: Scoring = "localisation"
    nothing: str | None = None
    kinds: Mapping[str, str]
    reversed_mapping: Mapping[str, str] = field(default_factory=dict)
    texts: Mapping[str, str]
    instructions: Mapping[frozenset[str], str]
    decide: Decision
    reference_vpp: float | None = None

    def __post_init__(self) -> None:
        if not self.presentations:
            raise ValueError(f"task {self.name} contradicts itself: no presentations")
        answers, kinds = {*self.answer_names}, {p.kind for p in self.presentations}
        optional = self.optional_answers
        offers = {
            frozenset(offer)
            for number in range(len(optional) + 1)
            for offer in combinations(optional, number)
        }
        driven = {site for p in self.presentations for burst in p.bursts for site in burst.sites}
        measured = {p.site for p in self.presentations if p.kind == SINGLE}
        for is_broken, rule in (
            (
                len({p.name for p in self.presentations}) < len(self.presentations),
                "two presentations have the same name",
            ),
            (len(answers) < len(self.answers), "answers twice"),
            ({len(p.bursts) for p in self.presentations} != {self.n_intervals}, "intervals"),
            (not {p.correct for p in self.presentations} <= answers, "correct answers"),
            (kinds != {*self.kinds}, "kinds"),
            (not driven <= {*self.sites}, "sites of bursts"),
            (measured != {*self.sites}, "sites of single trials"),
            (self.nothing not in {None, *answers}, "nothing"),
            (bool(answers & _RESERVED), "an answer has the name of another key or of no answer"),
            (self.scoring not in get_args(Scoring), "scoring"),
            (self.has_reference != (self.scoring == "discrimination"), "reference"),
            (not offers <= {*self.instructions}, "instructions"),
            (not {*self.texts} >= _TEXTS, "texts"),
        ):
            if is_broken:
                raise ValueError(f"task {self.name} contradicts itself: {rule}")

    @property
    def n_intervals(self) -> int:
        """The number of observation intervals of a trial."""
        return len(self.presentations[0].bursts)

    @property
    def has_reference(self) -> bool:
        """Whether bursts at the reference level are presented."""
        return any(burst.is_reference for p in self.presentations for burst in p.bursts)

    @property
    def is_identification(self) -> bool:
        """Whether answers identify one of the sites, so that they transfer information."""
        return self.scoring == "identification"

    @property
    def slots(self) -> tuple[tuple[str, ...], ...]:
        """The sites of each different burst, in the order of the device's slots."""
        return tuple(dict.fromkeys(b.sites for p in self.presentations for b in p.bursts))

    @property
    def n_sites_at_once(self) -> int:
        """The largest number of sites that a burst drives."""
        return max(map(len, self.slots))

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
    def correct_answers(self) -> tuple[str, ...]:
        """The answers that are correct to single stimuli."""
        return tuple(dict.fromkeys(shown.correct for shown in self.of_kind(SINGLE)))

    @property
    def optional_answers(self) -> tuple[str, ...]:
        """The answers that a study need not offer."""
        return tuple(answer.name for answer in self.answers if answer.optional)

    @property
    def keys(self) -> dict[str, tuple[str, ...]]:
        """The default keys of each answer."""
        return {answer.name: answer.keys for answer in self.answers}

    def presentation(self, name: str) -> Presentation:
        """Return a presentation.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        Presentation
        """
        return next(p for p in self.presentations if p.name == name)

    def of_kind(self, kind: str) -> tuple[Presentation, ...]:
        """Return the presentations of a kind.

        Parameters
        ----------
        kind : str
            One of `kinds`.

        Returns
        -------
        tuple of Presentation
        """
        return tuple(p for p in self.presentations if p.kind == kind)

    def at_site(self, site: str) -> tuple[Presentation, ...]:
        """Return the presentations that measure the threshold of a site.

        Parameters
        ----------
        site : str
            One of `sites`.

        Returns
        -------
        tuple of Presentation
        """
        return tuple(p for p in self.of_kind(SINGLE) if p.site == site)

    def levels_vpp(self, presentation: str, level_vpp: Any) -> list[list[Any]]:
        """Return the level of each burst at each site.

        Parameters
        ----------
        presentation : str
            What the trial presents.
        level_vpp : float or array
            Level of the trial, peak-to-peak volts.

        Returns
        -------
        list of list of float or array
            By interval and site.
        """
        return [
            [
                ((self.reference_vpp or 0.0) if burst.is_reference else level_vpp)
                * (site in burst.sites)
                for site in self.sites
            ]
            for burst in self.presentation(presentation).bursts
        ]

    def easiest_vpp(self, levels_vpp: tuple[float, ...]) -> float:
        """Return the level with which to practise.

        Parameters
        ----------
        levels_vpp : tuple of float
            Levels of the study, peak-to-peak volts.

        Returns
        -------
        float
            The highest level; in a comparison, the level farthest from the reference in dB.
        """
        if self.reference_vpp is None:
            return max(levels_vpp)
        reference_vpp = self.reference_vpp
        return max(levels_vpp, key=lambda vpp: max(vpp / reference_vpp, reference_vpp / vpp))

    def offered(self, responses: tuple[str, ...], *, hands_off: bool) -> tuple[str, ...]:
        """Return the answers that count: with the hands off, `nothing` always does.

        Parameters
        ----------
        responses : tuple of str
            Those that the study offers.
        hands_off : bool
            Whether the hands are off the plate.

        Returns
        -------
        tuple of str
        """
        more = () if self.nothing is None or not hands_off else (self.nothing,)
        return tuple(dict.fromkeys((*responses, *more)))

    def is_correct(
        self, presentation: str, level_vpp: float | None, response: str | None
    ) -> bool | None:
        """Return whether an answer names what was presented.

        Parameters
        ----------
        presentation : str
            What the trial presented.
        level_vpp : float or None
            Level of the trial, peak-to-peak volts.
        response : str or None
            The answer.

        Returns
        -------
        bool or None
            None without an answer, and where the level of the trial equals the reference.
        """
        shown = self.presentation(presentation)
        if response is None or (level_vpp is not None and level_vpp == self.reference_vpp):
            return None
        is_below = (level_vpp or 0.0) < (self.reference_vpp or 0.0)
        return response == (shown.correct_below if is_below else shown.correct)

    def is_detected(self, presentation: str, response: str) -> bool:
        """Return whether a trial counts as detected; of a blank trial, as a false alarm.

        Parameters
        ----------
        presentation : str
            What the trial presented.
        response : str
            The answer.

        Returns
        -------
        bool
            Whether it counts; in a comparison, whether the level was judged stronger than the
            reference.
        """
        shown = self.presentation(presentation)
        if shown.kind != BLANK:
            return response == shown.correct
        return response in self.answer_names and response != self.nothing

    def guess_rate(self, responses: tuple[str, ...]) -> float | None:
        """Return the guess rate of a forced choice.

        Parameters
        ----------
        responses : tuple of str
            The answers that the study offers.

        Returns
        -------
        float or None
            None where blank trials estimate it; 0 in a discrimination.
        """
        if self.scoring == "discrimination":
            return 0.0
        return None if self.nothing in responses else 1 / len(responses)

"""What every number of an analysis means, the names of methods, and the order of people."""

from __future__ import annotations

import re
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd


LIMITS: Final = (0.025, 0.975)
"""The points of a distribution between which a 95 % interval lies."""

DEFINITIONS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "presented": "trials of the kind with status ok, not premature, neither noise_ok nor "
        "burst_verified false",
        "detected": "single stimuli answered with their own side and nothing else",
        "p": "detected (noticed, felt) / presented; time-outs and invalid keys stay in presented",
        "low, high": "95 % interval of one participant's p, by the method under ci; in a last row "
        "'all' it ignores that participants differ",
        "p_min": "least p of the participants",
        "p_mean": "unweighted mean of the participants' p",
        "p_max": "largest p of the participants",
        "p_pooled": "detected / presented over all participants",
        "group_low, group_high": "95 % interval of the mean of people like the participants, if "
        "their p are Beta distributed: of its posterior, with flat priors of the mean and of their "
        "spread (in blank.csv, in a row 'all', with priors of few false alarms), which mostly tell "
        "the far limit near 0 and 1 where people are few; none for one participant",
        "over_report": "single stimuli answered both",
        "mislocalised": "single stimuli answered with the other side",
        "timeouts": "single stimuli (in hands_off.csv: hands-off trials) without an answer in time",
        "p_answered": "detected / (presented without time-outs and invalid keys)",
        "detected_any": "single stimuli answered left, right or both; null where the answer "
        "none was not offered",
        "noticed": "both-finger trials answered both",
        "left_only, right_only": "both-finger trials answered with one side",
        "left, right, both": "blank trials with this answer, each a false alarm; in confusion.csv "
        "and hands_off.csv trials with this answer",
        "part": "of hands-off trials, which are in no other table: before practice, or "
        "after the task",
        "none": "trials answered none",
        "timeout": "trials without an answer in time",
        "invalid": "trials answered with a key that is none of the answers'",
        "kind": "single, both or blank",
        "side": "where the stimulus was, or which side was driven",
        "counted": "whether a trial is counted",
        "reason": "the first reason that holds why a trial is not counted; n/a where it is",
        "threshold_vpp": "level felt half of the time: detected (1 + gamma - lambda)/2 of the "
        "time, half-way between false alarms or guesses (gamma) and what lapses (lambda) leave, "
        "1 - lambda; posterior median, volts peak-to-peak; in a row 'all' the middle of the group, "
        "in which everybody takes part",
        "threshold_low_vpp, threshold_high_vpp": "95 % equal-tailed limits of the threshold; one "
        "outside the tested levels is open (n/a)",
        "spread_db": "standard deviation of thresholds between participants, posterior median, dB "
        "(on a linear axis the levels' unit); in a row 'all' of differences.csv that of their "
        "differences, of the same people; below five participants mostly from its prior",
        "spread_low_db, spread_high_db": "95 % limits of that spread",
        "new_low_vpp, new_high_vpp": "where another participant's threshold is expected, 95 %",
        "condition_a": "of a difference: the condition that the other is compared with",
        "condition_b": "of a difference: the other; told is by how much it lies above condition_a",
        "difference_db": "20 log10(threshold b / threshold a), posterior median, without the "
        "thresholds' priors, and so not their ratio; of a participant from the own answers, only "
        "the slope drawn towards the others'; n/a where an end is open",
        "low_db, high_db": "95 % limits of that difference; n/a where open",
        "first": "of a difference: the condition that was over before the other began; "
        "'interleaved' where trials of both take turns, 'alternated' where blocks do; in a row "
        "'all' how many participants had which first",
        "false_alarms": "blank trials answered left, right or both; with _a and _b of the "
        "conditions of a difference",
        "blanks": "blank trials that count; with _a and _b of the conditions of a difference",
        "false_alarm_difference": "in a row 'all' of a difference: false alarms / blanks in b less "
        "those in a, mean of the participants with blank trials in both, or the difference of the "
        "means of different ones; n/a in other rows",
        "false_alarm_difference_low, false_alarm_difference_high": "its 95 % limits by Student's "
        "t, of different participants by Welch's; n/a, too, where there is one such participant or "
        "all differ by the same",
        "felt": "single stimuli answered left, right or both; with _a and _b of the conditions of "
        "a difference, as presented",
        "d_prime": "z(felt) - z(false alarms), with half a trial more of either kind in each rate; "
        "in a row 'all' the mean of the participants; with _a and _b of the conditions of a "
        "difference, over the levels of both, or in d_prime_differences.csv at one level",
        "d_prime_low, d_prime_high": "95 % limits of d'; in a row 'all' by Student's t, n/a where "
        "all have the same",
        "d_prime_difference": "d_prime_b - d_prime_a",
        "d_prime_difference_low, d_prime_difference_high": "95 % limits of that difference: of a "
        "participant from those of both d', added in quadrature; in a row 'all' by Student's t "
        "within participants, by Welch's where they are others",
        "d_prime_answered": "d' of the answered trials alone, without time-outs and invalid keys",
        "threshold_db": "the threshold in dB re 1 V peak-to-peak",
        "threshold_low_db, threshold_high_db": "its 95 % limits in dB re 1 V peak-to-peak",
        "status": "ok, or why there is no threshold or how it is limited; of a difference whether "
        "both ends of its interval are bounded: ok, at_least, at_most or unknown, or "
        "one_participant",
        "printed": "the threshold, or the difference, as a reader is told it",
        "sigma": "width of the psychometric function, posterior median: log10 units, or the "
        "levels' unit on an axis of dB or a linear one",
        "function": "psychometric function in the figure of detection, of the group or an only "
        "participant",
        "function_low, function_high": "its 95 % band at each level by itself",
        "lapse_rate": "share of felt stimuli that are missed, posterior mean",
        "mle_threshold_vpp": "the likeliest threshold",
        "mle_sigma": "the likeliest sigma",
        "mle_lapse_rate": "the likeliest lapse rate",
        "deviance": "misfit at the likeliest values",
        "deviance_p": "share of tables drawn from the likeliest values (seeded) that fit no better",
        "guess_rate": "chance of a correct answer without feeling anything",
        "guess_basis": "how that chance is known",
        "guess_posterior": "posterior mean of that chance, weak levels included; a function that "
        "is drawn starts there",
        "threshold_guess_0_vpp": "the threshold if the guess rate were 0",
        "threshold_guess_third_vpp": "the threshold if the guess rate were 1/3",
        "varied_low_vpp, varied_high_vpp": "limits of the threshold if answers vary 2.8 times the "
        "binomial, as in Grund et al. 2022; only where none could be answered",
        "varied_printed": "these limits as a reader is told them",
        "threshold_left_um, threshold_right_um": "the threshold times the displacement per volt of "
        "the finger on this side over its own actuator, as trials.csv has it; n/a where it has "
        "none, or more than one",
        "displacement_basis": "what these micrometres rest on; n/a where they are",
        "levels": "how many the fit is of",
        "trials": "how many the fit is of",
        "n": "correct answers to single stimuli with a time",
        "median": "of their reaction times, seconds",
        "p10": "10 % point of their reaction times, seconds",
        "p90": "90 % point of their reaction times, seconds",
    }
)


def counted_up(participant: str) -> str:
    """Return what participants are sorted by: numbers in their names by size, not by digits.

    >>> sorted(["10", "9", "P2", "P11"], key=counted_up)
    ['9', '10', 'P2', 'P11']
    """
    padded = re.sub(r"[0-9]+", lambda number: number[0].lstrip("0").zfill(20), participant)
    return f"{padded}\0{participant}"  # 2 and 02 are two people, always in the same order


def in_order(column: pd.Series) -> pd.Series:
    """Return by what `sort_values` sorts a column of a table: participants by `counted_up`."""
    return column.astype(str).map(counted_up) if column.name == "participant" else column


def definitions_in(unit: str) -> Mapping[str, str]:
    """Return `DEFINITIONS` for levels of a unit that are no volts peak-to-peak.

    >>> definitions_in("vol")["threshold_db"]
    'the threshold in dB re 1 vol'
    """
    in_db = unit if unit.lower().startswith("db") else f"dB re 1 {unit}"
    volts = ("dB re 1 V peak-to-peak", in_db), ("volts peak-to-peak", unit)
    told = {names.replace("_vpp", ""): text for names, text in DEFINITIONS.items()}
    for words, own in (*volts, ("or volts on a linear", f"or {unit} on a linear")):
        told = {names: text.replace(words, own) for names, text in told.items()}
    return told | {"unit": "of the levels and thresholds in the row"}


OF_SIDES: Final = (
    "over_report",
    "mislocalised",
    "detected_any",
    "noticed",
    "left_only, right_only",
    "left, right, both",
    "part",
    "none",
    "side",
    "threshold_left_um, threshold_right_um",
    "displacement_basis",
)
"""Keys of `DEFINITIONS` that mean nothing where there is one place."""

OF_ONE_PLACE: Final[Mapping[str, str]] = MappingProxyType(
    {
        "presented": "stimuli, or blank trials, that count",
        "detected": "stimuli answered as felt",
        "timeouts": "stimuli without an answer in time",
        "felt": "trials answered as felt; of blank trials each is a false alarm; with _a and _b of "
        "the conditions of a difference, as presented",
        "not_felt": "trials answered as not felt",
        "false_alarms": "blank trials answered as felt; with _a and _b of the conditions of a "
        "difference",
        "kind": "single (a stimulus) or blank",
    }
)
"""What stands in their stead."""

METHODS = ("wilson", "jeffreys", "clopper-pearson")

MOST_PRESENTED = 10**12
"""Of a table of counts; up to here sums of them are exact, and so are fits."""

TOTAL = "all"

GROUP_COVERS: Final = (
    "The group's interval is of the mean of people like these. Of few people its far limit (the "
    "upper one near 0, the lower one near 1) is mostly the prior's: where nearly all or nearly "
    "nothing was felt the data hardly tell how much people differ. There it lies "
    "farther out than need be: in simulations of five and of six people no true mean below .12 "
    "or above .89 lay beyond it. In those of five to twelve people who differ by 2 to 6 dB the "
    "interval covered 87 to 97 % of true means from .1 to .98, of five very steep people as little "
    "as 86 %, and of means above .99 as little as 79 %."
)
"""What a reader of the interval has to know; measured as docs/statistics.md tells."""

FAR_LIMIT: Final = (
    "of the mean of people like these; of few people the upper limit near 0 and the lower near 1 "
    "are mostly the prior's"
)
"""The same in half a sentence."""

CENSORED: Final = (
    "A threshold outside the tested levels is told as below or above them, never as a number; so "
    "is a limit. Everybody takes part in the group's threshold, those below and above included. "
    "A participant's interval is for that session; what another day brings needs a second one."
)

VARY: Final = (
    'Where "none" could be answered, the answers of real people near threshold varied 2.8 times '
    "the binomial (M. Grund et al., J. Neurosci. 42 (2022) 643-656). No such factor can be found "
    'from one session: a column "if answers vary 2.8 times" has a threshold\'s limits for it. '
    "Report the interval beside the threshold, which is of this session; the wider one is a "
    "sensitivity analysis, for a statement on the same person in the long run."
)

COUNTING: Final = (
    "A trial counts where its status is ok, it was not premature, its masking noise was not "
    "known to be silent, and it is of one of the three kinds below. trials_clean.csv has every "
    "trial with the reason why it was left out."
)

COUNTING_ONE_PLACE: Final = (
    "A trial counts where it is a stimulus or a blank, and no column of its table (as status, "
    "premature) says that it was not valid. trials_clean.csv has every trial with the reason why "
    "it was left out."
)
"""Of a table made elsewhere with one place."""

OFF_THE_PLATE: Final = (
    "Hands-off trials, with the masking noise on and no finger on the plate; they are in "
    "no other number here. More answers with the driven side than with the other say that "
    "the plate is heard or seen."
)

CRITERION: Final = (
    "Where false alarms differ, a difference of thresholds may in whole or in part be one of the "
    "willingness to answer (the criterion) and not of what is felt. d' at single levels tells (see "
    "Sensitivity). d' over all levels, as in the tables of differences here, does not: the "
    "criterion moves it, too."
)
"""What false alarms and d' beside a difference are there for."""

D_PRIME_APART: Final = (
    "d' of two conditions by level: the mean of the participants' differences with its interval by "
    "Student's t, Welch's where the participants are others. These are several intervals, not "
    "corrected for their number. A difference of criterion alone hardly moves d' at levels at "
    "which up to nine in ten stimuli are felt. Above, d' depends little on the level and mostly "
    "on the false alarms: it looks higher where these are fewer."
)
"""How to read d' of two conditions, as simulated (docs/statistics.md)."""

D_PRIME: Final = (
    "d' compares what was felt at a level with what was felt of blank trials; unlike a proportion, "
    "at one level it hardly moves with the willingness to answer (the criterion). Over all levels "
    "together it does, and with the levels that were presented. Rows 'all' have the mean of the "
    "participants."
)

POPULATION: Final = (
    "A second opinion by another model, a logistic one: everybody takes part, also who has no "
    "threshold of their own, with one slope for all. It leaves out lapses and guesses (and is "
    "refused where blank trials show a guess rate above 0.03): misses of what is felt raise its "
    "threshold, guesses lower it."
)
"""What the population model leaves out."""

FITTED_RATES: Final = (
    "The false-alarm rate of a fit is (a + 1/2)/(b + 1), the posterior mean after a false alarms "
    "in b blank trials; the plain proportions stand under Blank trials. It is of the blanks alone; "
    "a function that is drawn starts at the posterior mean, for which weak levels count, too."
)

FITTED_GUESSES: Final = (
    "The guess rate is no false-alarm rate. The function is of one side, that of the stimulus, so "
    "that its guess rate is (a + 1/2)/(b + 1) with a half of the answers left and right to b blank "
    "trials: about half of the false alarms under Blank trials, which may name either side. It is "
    "of the blanks alone; a function that is drawn starts at the posterior mean, for which weak "
    "levels count, too."
)

LAPSES: Final = (
    "Lapse at bound: the likeliest lapse rate is the largest that is allowed, 0.1, for much was "
    "missed at high levels (wrong answers and time-outs are misses, too) or too few trials lie "
    "above the threshold to tell; the table has posterior means, which lie below the likeliest "
    "rate. The threshold may be reported, with its interval, which allows for every lapse rate up "
    "to 0.1, and with this remark. In simulations (six levels, 16 or 24 trials each) it is the "
    "status of 2 to 43 % of functions of people who miss 3 % of what is surely felt, the more the "
    "fewer levels lie above the threshold, and of 44 to 54 % if they miss 10 %."
)

LAPSES_OFTEN: Final = (
    "which is common where few trials lie above the threshold or some strong stimuli are missed, "
    "and no reason to leave a threshold out"
)
"""The same in half a sentence."""

LAPSES_ERROR: Final = (
    "in simulations of people who miss up to 10 % of what is surely felt the group's threshold was "
    "between 0.3 dB too low and 0.6 dB too high"
)
"""What many such functions mean for the group (docs/statistics.md)."""

LAPSES_MANY: Final = (
    "no reason to leave a threshold out; so many are usual where few trials lie above the "
    "threshold, and where one in ten stimuli that are surely felt is missed, by wrong answers and "
    f"time-outs, too; which of these it is, data hardly tell: {LAPSES_ERROR}"
)
"""The same of a large share."""

BLANK_INTERVALS: Final = (
    'To quote: the share of all with the interval under "Group, 95 %", which is of the mean of '
    "people like these and stands in the answer (where conditions were interleaved and nothing "
    "told which was coming, that of all blanks there); of one participant the share with that "
    "one's interval. Of few people the upper limit of the group's is cautious. The {} "
    "interval of a row 'all' is narrower, for it ignores that participants differ."
)
"""Which interval of false alarms to report."""

BOTH_INTERVALS: Final = (
    'To quote: the share of all with the interval under "Group, 95 %", which is of the mean of '
    "people like these; of one participant the share with that one's interval. Of few people the "
    "limit of the group's that is farther from 0 or 1 is mostly its prior's. The {} interval of a "
    "row 'all' is narrower, for it ignores that participants differ."
)
"""The same of both-finger trials, most of which are noticed."""

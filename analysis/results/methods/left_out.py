"""What was left out of the trials that were read, and why, and what a map did not let be read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from analysis.results.methods.words import number_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.results.tables import Analysis


REASONS: Final = {
    "practice": "practice",
    "hands_off": "hands off the plate",
    "voided": "presented again",
    "premature": "premature response",
    "unmasked": "without masking noise",
    "unverified": "not measured as planned",
    "never_answered": "nothing but time-outs in a condition",
    "device_error": "device failed",
    "indeterminate": "perhaps not felt",
    "aborted": "given up before the stimulus",
}
"""What a reason is called in a sentence, in the order in which they are told."""


def _reasons(analysis: Analysis) -> list[tuple[str, int]]:
    """Return why trials are left out, and how many each."""
    found = analysis.excluded.groupby("reason")["trials"].sum().to_dict()
    order = [*REASONS]
    return [
        (REASONS.get(str(reason), str(reason)), int(found[reason]))
        for reason in sorted(found, key=lambda one: order.index(one) if one in order else 99)
    ]


def left_out_words(analysis: Analysis) -> str:
    """Say what was left out of the trials that were read, and why."""
    counts = analysis.counts
    if counts.trials and analysis.trials.empty:
        return "counts were read, which do not tell what was left out of them"
    if not counts.left_out:
        if unread_words(analysis):
            return f"all {counts.trials} trials that were read count"
        return f"nothing was left out: all {counts.trials} trials count"
    part = 100 * counts.left_out / counts.trials
    told = ", ".join(f"{words} {number}" for words, number in _reasons(analysis))
    return f"{counts.left_out} of {counts.trials} trials ({part:.1f} %) are left out: {told}"


def left_out_for_paper(analysis: Analysis) -> str:
    """Say what was left out, by a map as well, which knows no reason for it."""
    unread = unread_words(analysis)
    if not unread:
        return left_out_words(analysis)
    one = analysis.counts.unread + analysis.counts.unread_files == 1
    keys = analysis.left_out_by.replace("[", "").replace("]", "")
    rule = f"; left out by {keys}" if keys else ""
    were = "was" if one else "were"
    by_map = f"{unread} of the tables {were} left out [say what was in them{rule}]"
    told = analysis.counts.left_out or analysis.trials.empty
    return f"{left_out_words(analysis)}; {by_map}" if told else by_map


def unread_words(analysis: Analysis) -> str:
    """Return how many rows and files of the tables a map leaves out; empty text without any."""
    counts = analysis.counts
    of = (counts.unread, "row"), (counts.unread_files, "file")
    return " and ".join(number_of(number, noun) for number, noun in of if number)


def left_out_rows(analysis: Analysis) -> Iterator[tuple[str, str, str]]:
    """Yield the rows of the answer's table about it."""
    counts = analysis.counts
    told = ", ".join(f"{words} {number}" for words, number in _reasons(analysis))
    row = f"{counts.left_out} of {counts.trials}", told or "none"
    if counts.trials and analysis.trials.empty:
        row = "n/a", "a table of counts"
    yield "Trials left out", *row
    if unread := unread_words(analysis):
        by = f", by {analysis.left_out_by}" if analysis.left_out_by else ""
        yield "Left out by the map", unread, f"besides{by}; a paper has to say what they are"

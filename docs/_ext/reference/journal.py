"""The events of the journal, with what each line holds beside its time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiment.archive import journal
from reference.markdown import code, literal, prose, table

if TYPE_CHECKING:
    from typing import Any

    from reference.sample import Sample


def page(sample: Sample) -> str:
    """Write the page."""
    entries = sample.journal()
    every = set(entries[0]).intersection(*map(set, entries))
    rows = [
        (literal(event), meaning, _facts([e for e in entries if e["event"] == event], every))
        for event, meaning in journal.EVENTS.items()
    ]
    return "\n".join(
        [
            "# Events of the journal\n",
            f"{prose(journal.__doc__)}\n",
            "Every line has:\n",
            code(" ".join(name for name in entries[0] if name in every)),
            (
                "`t_s` is the session's clock, `wall_s` the calendar's (seconds since 1970), "
                "`up_s` the time since the computer was started.\n"
            ),
            table(("event", "meaning", "beside it, in a simulated session"), rows),
        ]
    )


def _facts(entries: list[dict[str, Any]], every: set[str]) -> str:
    found = [*dict.fromkeys(name for entry in entries for name in entry if name not in every)]
    return ", ".join(map(literal, found))

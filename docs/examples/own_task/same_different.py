"""Same or different: two bursts one after the other, at one site or at two."""

from experiment import Answer, Burst, Presentation, Task

TEXT = "You feel two vibrations. Press {same} if both are at one place, else {different}."


def decide(intervals, _responses, guessing):
    """Answer different where both bursts are felt, at different sites; else it is a guess."""
    (first_left, first_right), (left, right) = (each.detected for each in intervals)
    felt = first_left * (1 - first_right) * right * (1 - left)
    felt = felt + first_right * (1 - first_left) * left * (1 - right)
    different = felt + (1 - felt) * guessing.false_alarm
    return {"same": 1 - different, "different": different}


def presentation(first, second):
    """Make what a trial presents: a burst at one site, then one at the same or at the other."""
    is_same = first == second
    return Presentation(
        name=f"{first}_{second}",
        kind="blank" if is_same else "single",
        bursts=(Burst((first,)), Burst((second,))),
        correct="same" if is_same else "different",
        site=None if is_same else second,
        meaning=f"first at the {first} finger, then at the {second} finger",
    )


def same_different(sites):
    """Make the task; trials of the kind blank measure how often "different" is guessed."""
    return Task(
        name="same-different",
        sites=sites,
        presentations=tuple(presentation(first, second) for first in sites for second in sites),
        answers=(
            Answer(name="same", keys=("s", "left"), meaning="at one place", sign="="),
            Answer(name="different", keys=("d", "right"), meaning="at two places", sign="≠"),
        ),
        scoring="yes-no",
        nothing="same",
        kinds={"single": "bursts at two sites", "blank": "both bursts at one site"},
        reversed_mapping={"same": "different", "different": "same"},
        texts={
            "placement": "Place one finger of each hand on the plate, one above each actuator.",
            "hands_off_before": f"Take both hands off the plate. {TEXT}",
            "hands_off_after": f"Take both hands off the plate. {TEXT}",
            "prompt": "Were they at the same place?",
            "prompt_hands_off": "Were they at the same place?",
        },
        instructions={frozenset(): TEXT},
        decide=decide,
    )

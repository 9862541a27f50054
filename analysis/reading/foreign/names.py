"""What others call our columns and our words, in small letters and digits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Mapping


LEVELS: Final = ("level", "stimlevel", "intensity", "stimintensity", "amplitude", "amp")
OF_VOLTS: Final = ("vpp", "volt", "volts", "voltage")
CALLED: Final[Mapping[str, tuple[str, ...]]] = {
    "participant": (
        *("participant", "participantid", "subject", "subjectid", "subj", "subjid", "sub", "ppid"),
        *("pid", "observer", "subjectnr", "subjectnumber", "participantnumber", "vp", "vpn", "id"),
    ),
    "session": ("session", "sessionid", "ses", "visit"),
    "condition": ("condition", "cond"),
    "trial": ("trial", "trialnumber", "trialnum", "trialno", "trialn", "thisn", "trialindex"),
    "side": ("side", "stimside", "stimulusside", "targetside", "location", "hand", "finger"),
    "level_vpp": (
        *("levelvpp", *LEVELS, "voltage", "volts", "volume", "gain", "strength", "contrast"),
        *("soa", *(f"{name}{unit}" for unit in ("um", "m", "nm", "mm", "pct") for name in LEVELS)),
    ),
    "response": ("response", "resp", "answer", "keys", "choice", "keypress", "key"),
    "rt_s": ("rts", "rt", "responsetime", "reactiontime", "resprt", "latency", "rtms"),
}
"""The first that a heading has is taken."""
HITS: Final = (
    *("detected", "correct", "corr", "responsecorrect", "respcorr", "iscorrect", "felt", "hit"),
    *("accuracy", "acc", "yes"),
)
COUNTS: Final = ("k", "detected", "correct", "hits", "ncorrect", "yes", "nyes", "ndetected")
OF: Final = ("n", "presented", "total", "ntotal", "ntrials", "trials", "shown")
WORDS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("l", "left", "arrowleft", "leftarrow", "links"), "left"),
    **dict.fromkeys(("r", "right", "arrowright", "rightarrow", "rechts"), "right"),
    **dict.fromkeys(("b", "both"), "both"),
    **dict.fromkeys(("no", "nothing", "blank", "catch", "null", "none"), "none"),
}
FELT: Final[Mapping[str, str]] = {
    **dict.fromkeys(("true", "yes", "y", "ja", "j", "oui", "o", "1"), "1"),
    **dict.fromkeys(("false", "no", "n", "nein", "non", "0"), "0"),
}

"""What others call our columns and our words, in small letters without accents, and digits.

In English, German and French; and what the words of a column of answers are, therefore.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Mapping


LEVELS: Final = (
    *("level", "stimlevel", "intensity", "stimintensity", "amplitude", "amp"),
    *("pegel", "stufe", "intensitat", "intensite", "niveau"),
)
OF_VOLTS: Final = ("vpp", "volt", "volts", "voltage", "spannung", "tension")
CALLED: Final[Mapping[str, tuple[str, ...]]] = {
    "participant": (
        *(
            "participant",
            "participantid",
            "person",
            "personid",
            "subject",
            "subjectid",
            "subj",
            "subjid",
            "sub",
            "ppid",
        ),
        *("pid", "observer", "subjectnr", "subjectnumber", "participantnumber", "vp", "vpn", "id"),
        *("versuchsperson", "proband", "teilnehmer", "sujet"),
    ),
    "session": ("session", "sessionid", "ses", "visit", "sitzung", "seance"),
    "condition": ("condition", "cond", "bedingung"),
    "trial": (
        "trial",
        "trialnumber",
        "trialnum",
        "trialno",
        "trialn",
        "thisn",
        "trialindex",
        "durchgang",
        "essai",
    ),
    "side": (
        *("side", "stimside", "stimulusside", "targetside", "location", "hand", "finger"),
        *("seite", "cote"),
    ),
    "level_vpp": (
        *("levelvpp", *LEVELS, *OF_VOLTS[2:], "volume", "gain", "strength", "contrast"),
        *("soa", *(f"{name}{unit}" for unit in ("um", "m", "nm", "mm", "pct") for name in LEVELS)),
    ),
    "response": (
        *("response", "resp", "answer", "keys", "choice", "keypress", "key", "ans", "reply"),
        *("judgment", "judgement", "percept", "report", "verdict"),
        *("antwort", "taste", "reponse", "touche"),
    ),
    "rt_s": (
        *("rts", "rt", "responsetime", "reactiontime", "resprt", "latency", "rtms"),
        *("reaktionszeit", "tempsdereaction", "tempsdereponse"),
    ),
}
"""The first that a heading has is taken."""
HITS: Final = (
    *("detected", "correct", "corr", "responsecorrect", "respcorr", "iscorrect", "felt", "hit"),
    *("accuracy", "acc", "yes", "richtig", "korrekt", "gespurt", "juste", "detecte", "percu"),
)
COUNTS: Final = ("k", "detected", "correct", "hits", "ncorrect", "yes", "nyes", "ndetected")
OF: Final = ("n", "presented", "total", "ntotal", "ntrials", "trials", "shown")
WORDS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("l", "left", "arrowleft", "leftarrow", "links", "gauche"), "left"),
    **dict.fromkeys(("r", "right", "arrowright", "rightarrow", "rechts", "droite"), "right"),
    **dict.fromkeys(("b", "both", "beide", "lesdeux"), "both"),
    **dict.fromkeys(
        (
            "no",
            "nothing",
            "blank",
            "catch",
            "null",
            "none",
            "nichts",
            "rien",
            "keine",
            "aucun",
            "aucune",
            "catchtrial",
        ),
        "none",
    ),
}
FELT: Final[Mapping[str, str]] = {
    **dict.fromkeys(("true", "yes", "y", "ja", "j", "oui", "o", "1"), "1"),
    **dict.fromkeys(("false", "no", "n", "nein", "non", "0"), "0"),
}
CATCH: Final = (
    *("catch", "catchtrial", "iscatch", "blank", "blanktrial", "isblank", "nulltrial"),
    *("leer", "leerversuch", "essaiblanc"),
)

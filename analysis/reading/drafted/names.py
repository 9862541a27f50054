"""What others call our columns and our words, in small letters without accents, and digits.

In English, German and French; and what the words of a column of answers are, therefore.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Mapping


LEVELS: Final = (
    *("level", "stimlevel", "intensity", "stimintensity", "amplitude", "amp", "displacement"),
    *("acceleration", "magnitude", "mag"),
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
        *("pid", "observer", "vp", "vpn", "versuchsperson", "proband", "teilnehmer", "sujet"),
        *(
            f"{who}{what}"
            for who in (
                "participant",
                "subject",
                "subj",
                "sub",
                "person",
                "vp",
                "sujet",
                "observer",
            )
            for what in ("nr", "no", "num", "number", "code", "name", "privateid", "publicid")
        ),
        *("prolificid", "prolificpid", "workerid", "recordid", "id"),
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
        *("levelvpp", *LEVELS, *OF_VOLTS[2:]),
        *(f"{name}{unit}" for unit in ("um", "m", "nm", "mm", "pct") for name in LEVELS),
        *("volume", "gain", "strength", "contrast", "soa"),
    ),
    "response": (
        *("response", "resp", "answer", "keys", "choice", "keypress", "key", "ans", "reply"),
        *("judgment", "judgement", "percept", "report", "verdict"),
        *("antwort", "taste", "reponse", "touche"),
    ),
    "rt_s": (
        *("rts", "rt", "responsetime", "reactiontime", "resprt", "latency", "rtms"),
        *("reaktionszeit", "tempsdereaction", "tempsdereponse", "resptime", "tr", "rz", "trms"),
        *("rzms", "reaktionszeitms", "reactiontimems", "responsetimems"),
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
_PERCEIVED: Final = (
    "felt",
    "detected",
    "seen",
    "perceived",
    "gespürt",
    "erkannt",
    "perçu",
    "senti",
)
_NOT: Final = ("not ", "not_", "not", "un", "nicht ", "non ", "pas ")
FELT: Final[Mapping[str, str]] = {
    **dict.fromkeys(("true", "yes", "y", "ja", "j", "oui", "o", "1", *_PERCEIVED), "1"),
    **dict.fromkeys(("false", "no", "n", "nein", "non", "0"), "0"),
    **{f"{no}{word}": "0" for no in _NOT for word in _PERCEIVED},
}
MISSED: Final = (
    *("timeout", "timed out", "time out", "no response", "no answer", "missed", "miss", "late"),
    *("keine antwort", "keine", "verpasst", "pas de réponse", "sans réponse", "manqué"),
)
"""How others write that nobody answered, in small letters, beside words of `NOTHING`."""
CATCH: Final = (
    *("catch", "catchtrial", "iscatch", "blank", "blanktrial", "isblank", "nulltrial"),
    *("leer", "leerversuch", "essaiblanc"),
)
PRESENT: Final = ("stimpresent", "present", "signalpresent", "targetpresent", "ispresent")
ABSENT: Final = ("absent", "nostimulus", "nostim", "nosignal")

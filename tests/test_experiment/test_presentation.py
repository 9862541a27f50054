"""What a study says to its participants and of its data: in any language, refused early."""

from __future__ import annotations

import json
from dataclasses import asdict, fields

import pytest

from experiment.commands.init import write_study_text
from experiment.study.read import paper_study, study_from_canonical, study_from_text
from experiment.study.sections.dataset import Dataset, ParticipantColumn
from experiment.study.sections.equipment import Masking
from experiment.study.sections.presentation import Keys, Screen, Texts
from experiment.study.study import StudyError

WHOLE = """
[study]
consent_version = "2.1 of 2025-03-01"
[masking]
noise = "pink"
max_level_dba = 70
measured_level_dba = 64.5
level_dbfs = -35
sound_card = "USB Audio"
loop_s = 12.5
sample_rate_hz = 44100
[screen]
full_screen = false
index = 1
width_px = 800
height_px = 600
text_height = 0.05
right_to_left = true
font = "Noto Sans Arabic"
[keys]
left = ["left", "num_4", "a"]
right = ["right", "num_6"]
go_on = ["return", "num_enter"]
[texts]
welcome = "\u200fأهلاً وسهلاً"
rest = "{planned} / {done}, {seconds}"
instructions = '''
שלום

ようこそ'''
[participants]
columns = [
    { name = "age", description = "in years" },
    { name = "handedness", description = "by questionnaire", levels = ["left", "right"] },
]
[dataset]
name = "Étude"
authors = ["A. Author", "B. Author"]
license = "CC0"
ethics_approvals = ["Board 1, 2025-17"]
task_description = "Where was it felt?"
[design]
audibility_trials = 6
control_trials = 10
"""


def refusal(text: str) -> str:
    with pytest.raises(StudyError) as caught:
        study_from_text(text, "s.toml")
    message = str(caught.value)
    assert message.startswith("s.toml:")
    assert "\n" not in message
    return message


def test_a_study_says_all_of_it_in_its_own_words() -> None:
    study = study_from_text(WHOLE, "s.toml")
    assert study.about.consent_version == "2.1 of 2025-03-01"
    assert study.masking == Masking(
        noise="pink",
        max_level_dba=70.0,
        measured_level_dba=64.5,
        level_dbfs=-35.0,
        sound_card="USB Audio",
        loop_s=12.5,
        sample_rate_hz=44_100.0,
    )
    assert study.screen == Screen(
        full_screen=False,
        index=1,
        width_px=800,
        height_px=600,
        text_height=0.05,
        right_to_left=True,
        font="Noto Sans Arabic",
    )
    assert study.keys.left == ("left", "num_4", "a")
    assert study.keys.both == ("down",)
    assert study.texts.welcome == "\u200fأهلاً وسهلاً"
    assert study.texts.instructions == "שלום\n\nようこそ"
    assert study.texts.prompt == Texts().prompt
    assert study.participants.columns == (
        ParticipantColumn(name="age", description="in years"),
        ParticipantColumn(
            name="handedness", description="by questionnaire", levels=("left", "right")
        ),
    )
    assert study.dataset == Dataset(
        name="Étude",
        authors=("A. Author", "B. Author"),
        license="CC0",
        ethics_approvals=("Board 1, 2025-17",),
        task_description="Where was it felt?",
    )
    assert (study.design.audibility_trials, study.design.control_trials) == (6, 10)


def test_it_survives_the_canonical_text_of_a_plan() -> None:
    study = study_from_text(WHOLE, "s.toml")
    assert study_from_canonical(study.canonical) == study


def test_a_file_without_any_of_it_has_every_default_in_its_canonical_text() -> None:
    tables = json.loads(paper_study().canonical)
    assert tables["texts"] == asdict(Texts())
    assert tables["participants"] == {"columns": []}
    assert (tables["study"]["consent_version"], tables["masking"]["loop_s"]) == (None, 30.0)
    # written out, the defaults are no other study
    assert study_from_text(write_study_text("paper"), "s.toml").sha256 == paper_study().sha256


def test_a_written_study_names_every_key_and_text() -> None:
    lines = write_study_text("recommended").splitlines()
    keys = {line.removeprefix("# ").split(" =")[0] for line in lines if " =" in line}
    for value in (Screen(), Keys(), Texts(), Dataset()):
        assert {field.name for field in fields(value)} <= keys
    assert {"consent_version", "audibility_trials", "control_trials", "columns"} <= keys


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[study]\nconsent_version = ''", "study.consent_version must be a name in one line"),
        ("[study]\nconsent_version = 2", "study.consent_version must be text; got 2"),
        ("[masking]\nmeasured_level_dba = 76", "masking.measured_level_dba must be a finite numbe"),
        ('[masking]\nsound_card = "a\\tb"', "masking.sound_card must be a name in one line"),
        ("[screen]\nfull_screen = 1", "screen.full_screen must be true or false; got 1"),
        ("[screen]\nfont = ''", "screen.font must be a name"),
        ("[screen]\nwidth = 1", "unknown key screen.width; did you mean width_px?"),
        ("[keys]\nleft = 'left'", "keys.left must be a list; got 'left'"),
        ("[keys]\nleft = []", "keys.left must have at least one key"),
        ("[keys]\nleft = ['right']", "keys.right must have keys without another meaning"),
        ("[keys]\nleft = ['a', 'a']", "another meaning; got a, which means left"),
        ("[keys]\nleft = ['enter']", "keys.left[0] must be a key's name"),
        ("[keys]\nleft = ['A']", "keys.left[0] must be a key's name"),
        ("[keys]\nleft = [',']", "keys.left[0] must be a key's name"),
        ("[texts]\nwelcome = ' '", "texts.welcome must hold something to read"),
        ("[texts]\nwelcom = 'a'", "unknown key texts.welcom; did you mean welcome?"),
        ('[texts]\nwelcome = "a\\u0007"', "texts.welcome must have no control characters"),
        ("[texts]\nwelcome = '{done}'", "texts.welcome must have no braces"),
        ("[texts]\nrest = '{minutes}'", "texts.rest may hold {done}, {planned}, {seconds}"),
        ("[texts]\npaused = '{seconds}'", "texts.paused may hold {done}, {planned}, and other"),
        ("[texts]\nrest = '{done'", "texts.rest may hold"),
        ("[texts]\nrest = '{}'", "texts.rest may hold"),
        ("[texts]\nrest = '{done!r}'", "texts.rest may hold"),
        ("[texts]\nrest = '{done:9}'", "texts.rest may hold"),
        ("[participants]\ncolumns = [{ name = 'a' }]", "columns[0].description is missing"),
        (
            "[participants]\ncolumns = [{ nme = 'a', description = 'b' }]",
            "unknown key participants.columns[0].nme; did you mean name?",
        ),
        (
            "[participants]\ncolumns = [{ name = 'participant_id', description = 'b' }]",
            "participants.columns[0].name must be 1 to 64 of a-z 0-9 _",
        ),
        (
            "[[participants.columns]]\nname = 'a'\ndescription = 'b'\n" * 2,
            "participants.columns must have distinct names",
        ),
        (
            "[participants]\ncolumns = [{ name = 'a', description = 'b', levels = ['c', 'c'] }]",
            "participants.columns[0].levels must be distinct",
        ),
        ("[dataset]\nlicense = ''", "dataset.license must be one line of text"),
        ("[dataset]\nauthors = 'A'", "dataset.authors must be a list"),
        ("[dataset]\nauthors = ['A', '']", "dataset.authors[1] must be one line of text"),
        ("[design]\naudibility_trials = 5", "design.audibility_trials must be even"),
    ],
)
def test_what_nobody_could_show_press_or_publish_is_refused_by_key(text: str, said: str) -> None:
    assert said in refusal(text)


def test_braces_beside_placeholders_are_doubled() -> None:
    text = study_from_text("[texts]\nrest = '{{{done}}}'", "s.toml").texts.rest
    assert text.format(done=3, planned=5, seconds=7) == "{3}"

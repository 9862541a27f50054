"""Messages that a user meets most: each is provoked when the site is built, with cause and cure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from reference.markdown import code
from reference.sample import tactstrip

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """Something that goes wrong often: what is typed, with which study or map, why, what helps."""

    title: str
    command: str
    study: str = ""
    columns: str = ""
    cause: str
    cure: str


SLIPS = (
    Slip(
        title="A key in the wrong unit",
        command="check study.toml",
        study="[strip]\nwidth_mm = 0.025\n",
        cause="The key's unit is the end of its name; 0.025 is the width in metres.",
        cure="Write the number in the key's unit. The message says it, where it can be meant.",
    ),
    Slip(
        title="A slip of the keyboard in a key",
        command="check study.toml",
        study="[design]\ntrails_per_side = 60\n",
        cause="No key of that section has this name. Unknown keys are never passed over.",
        cure="Take the key that is named, or look it up under [](study.md).",
    ),
    Slip(
        title="A number with a decimal comma",
        command="check study.toml",
        study='[strip]\nthickness_mm = "0,5"\n',
        cause="TOML has points, and a text in quotes is no number.",
        cure="Write `0.5`, without quotes.",
    ),
    Slip(
        title="A plate of one's own, and the paper's edge",
        command="check study.toml",
        study='[strip]\nwidth_mm = 30\nmaterial = "steel"\n',
        cause="The paper's plate is known by the cut-off that was measured on it; another plate "
        "has another.",
        cure="State the edge, or the cut-off that you measured. `tactstrip init --preset plate` "
        "asks for all that is needed.",
    ),
    Slip(
        title="A stimulus that is not fit",
        command="run study.toml --participant 01 --practice-without-device",
        study='[burst]\nfrequency_hz = 2500\nwindow = "hann"\n',
        cause="Too much of the burst's energy is above the plate's cut-off and would travel to the "
        "other finger.",
        cure="Lower the frequency, take more cycles or a smoother window; `tactstrip check` tells "
        "how far each gets. For a control condition, say why in `accept_unfit`.",
    ),
    Slip(
        title="A person, and no device",
        command="run study.toml --participant 01",
        cause="The study's driver is the mock device, which moves nothing; a person's answers to "
        "nothing must not be taken for data.",
        cure="Name the driver (`--driver serial --port ...`), or say "
        "`--practice-without-device` to try a session out.",
    ),
    Slip(
        title="Resuming what is not there",
        command="run study.toml --participant 07 --responder simulated --resume",
        cause="There is no session of this participant in the folder of results.",
        cure="Give the `--out` of the session, or leave out `--resume`.",
    ),
    Slip(
        title="A participant's name",
        command='run study.toml --participant "Jane Doe"',
        cause="Identifiers become names of folders and of a BIDS data set, and a person's name has "
        "no place there.",
        cure="Take letters and digits, such as `01`.",
    ),
    Slip(
        title="A table made elsewhere",
        command="analyze foreign.csv",
        cause="Its columns have names that are not ours.",
        cure="`tactstrip columns foreign.csv --write map.toml` drafts what they are called; then "
        "`tactstrip analyze foreign.csv --columns map.toml`.",
    ),
    Slip(
        title="Blanks without a level",
        command="analyze blanks.csv --columns map.toml",
        columns='[columns]\nparticipant = "subject"\nlevel_vpp = "amp_db"\nresponse = "ans"\n\n'
        '[values.response]\nyes = "left"\nno = "none"\n\n[constant]\nside = "left"\n\n'
        '[axis]\nx_scale = "dB"\nunit = "dB SL"\n',
        cause="A row has neither a level nor a side that says that there was no stimulus, and a "
        "level that got lost would look the same.",
        cure='Where such rows are blanks, write `"" = "-inf"` under `[values.level_vpp]`; of '
        'amplitudes, as in V or µm, `"" = "0"`. Where they are no trials, leave them out: '
        '`[rows.skip]` `amp_db = ""`. `tactstrip columns` drafts which of the two it seems to be.',
    ),
    Slip(
        title="Nothing to analyse",
        command="analyze empty",
        cause="The folder holds no trials.csv and no table.",
        cure="Name the folder of results, or the table.",
    ),
    Slip(
        title="A study file that exists",
        command="init study.toml",
        cause="What a lab has written is never overwritten.",
        cure="Name another file.",
    ),
    Slip(
        title="No such command",
        command="analyse results",
        cause="Commands are spelled as `tactstrip --help` lists them.",
        cure="`tactstrip --help` lists them all.",
    ),
)


def provoke(folder: Path, slip: Slip) -> tuple[int, str]:
    """Do what goes wrong, in a folder of its own; return exit code and message."""
    place = folder / slip.title.replace(" ", "-").replace("'", "").replace(",", "")
    place.mkdir()
    (place / "empty").mkdir()
    (place / "study.toml").write_text(slip.study, encoding="utf-8")
    foreign = "subject,stimulus,key,seconds\nA,L,f,0.61\nA,R,j,0.48\n"
    (place / "foreign.csv").write_text(foreign, encoding="utf-8")
    (place / "map.toml").write_text(slip.columns, encoding="utf-8")
    blanks = "subject,amp_db,ans\nA,-12,yes\nA,,no\n"
    (place / "blanks.csv").write_text(blanks, encoding="utf-8")
    words = [word.strip('"') for word in slip.command.replace('"Jane Doe"', "Jane_Doe").split()]
    done = tactstrip(place, *(word.replace("Jane_Doe", "Jane Doe") for word in words))
    return done.returncode, done.stderr.strip() or done.stdout.strip()


def page(folder: Path) -> str:
    """Write the page."""
    told = [
        "# Messages, their causes and cures\n",
        (
            "Each message is one line on stderr; nothing was written when it appears. What a study "
            "file or a map holds is shown as far as it matters.\n"
        ),
    ]
    for slip in SLIPS:
        exit_code, message = provoke(folder, slip)
        if not message.startswith("error: ") or "\n" in message:
            raise RuntimeError(f"{slip.title}: no error, or not one line: {message}")
        told.append(f"## {slip.title}\n")
        if toml := slip.study or slip.columns:
            told.append(code(toml, "toml"))
        shown = f":class: message\n\n$ tactstrip {slip.command}\n{message}"
        told.append(code(shown, "{code-block} text"))
        told.append(f"Exit code {exit_code}. {slip.cause}\n\n**What helps.** {slip.cure}\n")
    return "\n".join(told)

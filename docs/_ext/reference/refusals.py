"""Messages that users often meet: the build of the site provokes each, with cause and remedy."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from reference.markdown import code
from reference.sample import tactstrip

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """A frequent mistake: the command, the keys that differ from a preset, cause and remedy."""

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
        cause="The unit of a key is the end of its name; 0.025 is the width in metres.",
        cure="Write the number in the unit of the key.",
    ),
    Slip(
        title="A misspelt key",
        command="check study.toml",
        study="[design]\ntrails_per_side = 60\n",
        cause="The section has no key of this name. Unknown keys are never ignored.",
        cure="Look the key up under [](study.md), or let your editor complete it from "
        "study.schema.json.",
    ),
    Slip(
        title="A number with a decimal comma",
        command="check study.toml",
        study='[strip]\nthickness_mm = "0,5"\n',
        cause="A text in quotes is not a number, and TOML writes decimals with a point.",
        cure="Write `0.5`, without quotes.",
    ),
    Slip(
        title="A length without an actuator on it",
        command="check study.toml",
        study="[strip]\nlength_mm = 60\n",
        cause="The actuators lie at -35 mm and 35 mm from the middle, beyond the ends.",
        cure="Correct the length, or the `x_mm` of the actuators.",
    ),
    Slip(
        title="A stimulus that violates a limit",
        command="run study.toml --participant 01 --practice-without-device",
        study='[burst]\nfrequency_hz = 2500\nwindow = "hann"\n',
        cause="Too much of the energy of the burst lies above the cut-off frequency of the plate "
        "and reaches the undriven finger.",
        cure="Lower the frequency, or take more cycles or a smoother window; `tactstrip bursts` "
        "compares them. For a control condition, write the reason in `accept_violation`.",
    ),
    Slip(
        title="A person, and no device",
        command="run study.toml --participant 01",
        cause="The driver of the study is the mock device, which moves nothing. Responses to it "
        "must not be mistaken for data.",
        cure="Name the driver (`--driver serial --port ...`), or use "
        "`--practice-without-device` to try a session.",
    ),
    Slip(
        title="A session to resume that does not exist",
        command="run study.toml --participant 07 --responder simulated --resume",
        cause="There is no session of this participant in the folder of results.",
        cure="Give the `--out` of the session, or omit `--resume`.",
    ),
    Slip(
        title="The name of a participant",
        command='run study.toml --participant "Jane Doe"',
        cause="Identifiers become names of folders and of a BIDS data set, and a person's name "
        "does not belong there.",
        cure="Use letters and digits, such as `01`.",
    ),
    Slip(
        title="An external table",
        command="analyze foreign.csv",
        cause="Its columns have other names than those of tactstrip.",
        cure="`tactstrip columns foreign.csv --write map.toml` proposes a column map; then run "
        "`tactstrip analyze foreign.csv --columns map.toml`.",
    ),
    Slip(
        title="Blank trials without a level",
        command="analyze blanks.csv --columns map.toml",
        columns='[columns]\nparticipant = "subject"\nlevel_vpp = "amp_db"\nresponse = "ans"\n\n'
        '[values.response]\nyes = "left"\nno = "none"\n\n[constant]\nside = "left"\n\n'
        '[axis]\nx_scale = "dB"\nunit = "dB SL"\n',
        cause="A row without a level may be a blank trial or a trial whose level was lost.",
        cure='If such rows are blank trials, write `"" = "-inf"` under `[values.level_vpp]`, or '
        '`"" = "0"` for amplitudes in V or µm. If they are not trials, skip them: `[rows.skip]` '
        '`amp_db = ""`. `tactstrip columns` proposes one of the two.',
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
        cause="An existing file is never overwritten.",
        cure="Name another file.",
    ),
    Slip(
        title="A command that does not exist",
        command="analyse results",
        cause="The command is spelled `analyze`.",
        cure="`tactstrip --help` lists all commands.",
    ),
)


def provoke(folder: Path, slip: Slip) -> tuple[int, str]:
    """Run the command in its own folder; return its exit code and message."""
    from experiment.study.writing import changed_text, preset_text

    place = folder / slip.title.replace(" ", "-").replace("'", "").replace(",", "")
    place.mkdir()
    (place / "empty").mkdir()
    text = changed_text(preset_text("paper"), tomllib.loads(slip.study))
    (place / "study.toml").write_text(text, encoding="utf-8")
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
        "# Messages, their causes and remedies\n",
        (
            "Each message stands on stderr, with one line for each fault; nothing was written when "
            "it appears. Above it stand the lines in which the study file differs from the preset "
            "of the paper, or the column map.\n"
        ),
    ]
    for slip in SLIPS:
        exit_code, message = provoke(folder, slip)
        if not message.startswith("error: "):
            raise RuntimeError(f"{slip.title}: no error: {message}")
        told.append(f"## {slip.title}\n")
        if toml := slip.study or slip.columns:
            told.append(code(toml, "toml"))
        shown = f":class: message\n\n$ tactstrip {slip.command}\n{message}"
        told.append(code(shown, "{code-block} text"))
        told.append(f"Exit code {exit_code}. {slip.cause}\n\n**Remedy.** {slip.cure}\n")
    return "\n".join(told)

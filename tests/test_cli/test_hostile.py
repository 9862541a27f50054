"""Names and files that attack the terminal or the memory of whoever runs a command."""

from __future__ import annotations

import os
import shutil
import time
from typing import TYPE_CHECKING

import pytest

from tests.plates import PAPER_PLATE

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.conftest import Refused, Run

WIPE = "\x1b[2K\x1b[1A\r\x9b2J\u202e"
HOSTILE = f"x{WIPE}\nsub-01-ses-01: unmodified"
STUDY = f"{PAPER_PLATE}[design]\nlevels_vpp = [60, 80]\ntrials_per_side = 2\nboth_trials = 0\n"


def is_harmless(text: str) -> bool:
    return all(c.isprintable() or c in "\n\t" for c in text)


@pytest.mark.parametrize(
    "arguments",
    [
        ("verify", "{folder}"),
        ("export", "{folder}"),
        ("export", "{folder}", "--bids", "{folder}/bids"),
        ("withdraw", "{folder}", "--participant", "01", "--also", "{folder}"),
        ("withdraw", "{folder}", "--participant", "99"),
        ("analyze", "{folder}", "--no-figures"),
        ("analyze", "{folder}", "--no-figures", "--allow-simulated", "--out", "{folder}/new"),
        ("check", "{folder}/study.toml"),
        ("check", "{folder}"),
        ("check", "{folder}/none.toml"),
        ("run", "{folder}/none.toml", "--participant", "01"),
        ("run", "{folder}/study.toml", "--participant", HOSTILE),
        ("run", "{folder}/study.toml", "--participant", "01", "--driver", HOSTILE),
        ("levels", "{folder}", "--participant", HOSTILE),
        (HOSTILE,),
    ],
)
@pytest.mark.slow
def test_the_name_of_a_folder_writes_no_line_and_moves_no_cursor(
    arguments: tuple[str, ...], run: Run, tmp_path: Path, two_sessions: Path
) -> None:
    folder = tmp_path / HOSTILE
    shutil.copytree(two_sessions, folder)
    (folder / "sub-01" / f"ses-{HOSTILE}").mkdir()
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    filled = [argument.format(folder=folder) for argument in arguments]
    result = run(*filled, typed="no\n")
    assert is_harmless(result.output), result.output
    assert not any(line.startswith("sub-01-ses-01") for line in result.output.splitlines())
    assert result.exception is None or isinstance(result.exception, SystemExit)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--participant", "x" * 5000),
        ("--participant", "01", "--driver", "x" * 5000),
        ("--participant", "01", "--responder", "x" * 5000),
        ("--participant", "01", "--fact", "x" * 5000),
        ("--participant", "01", "--port", "x\n" * 5000),
    ],
)
def test_a_message_repeats_at_most_80_characters_of_a_value(
    arguments: tuple[str, ...], refused: Refused, tmp_path: Path
) -> None:
    study = tmp_path / "study.toml"
    study.write_text(STUDY, encoding="utf-8")
    simulated = () if "--responder" in arguments else ("--responder", "simulated")
    message = refused("run", study, *arguments, *simulated, "--out", tmp_path / "out")
    assert "x" * 40 in message or "x\\n" in message
    assert len(message) < 600


@pytest.mark.parametrize(
    "text",
    [
        f'[strip]\n"{WIPE}" = 1'.encode("unicode_escape").replace(b"\\n", b"\n", 1),
        b'[strip]\n"a\\u001b[2Kb" = 1\n',
        b'[burst]\nfile = "\\u001b[2K.csv"\n',
        b'[strip]\nmaterial = "\\u001b[2K"\n',
        b'[strip]\nmaterial = "' + b"x" * 10_000 + b'"\n',
    ],
)
def test_the_keys_and_values_of_a_study_do_not_reach_the_terminal_raw(
    text: bytes, refused: Refused, tmp_path: Path
) -> None:
    study = tmp_path / "study.toml"
    study.write_bytes(text)
    assert is_harmless(refused("check", study))


def huge(path: Path) -> None:
    path.write_bytes(b"#" * 1_000_001)


def deep(path: Path) -> None:
    path.write_text("a." * 60_000 + "a = 1\n", encoding="utf-8")


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


@pytest.mark.skipif(os.name != "posix", reason="FIFOs and devices have names")
@pytest.mark.parametrize("make", [huge, deep, endless, os.mkfifo])
@pytest.mark.parametrize("what", ["study", "levels", "map", "click"])
def test_no_file_is_read_beyond_its_bound(
    make: Callable[[Path], None], what: str, refused: Refused, tmp_path: Path
) -> None:
    study, table = tmp_path / "study.toml", tmp_path / "table.csv"
    bad = tmp_path / ("click.csv" if what == "click" else "bad.toml")
    study.write_text(STUDY + '[burst]\nfile = "click.csv"\n' * (what == "click"), "utf-8")
    table.write_text("a,b\n1,2\n", encoding="utf-8")
    make(bad)
    commands = {
        "study": ("check", bad),
        "levels": ("run", study, "--participant", "01", "--levels", bad),
        "map": ("analyze", table, "--columns", bad, "--out", tmp_path / "out"),
        "click": ("check", study),
    }
    began_s = time.monotonic()
    assert bad.name in refused(*commands[what])
    assert time.monotonic() - began_s < 20.0


def test_the_search_after_a_withdrawal_reads_small_regular_files_only(
    run: Run, tmp_path: Path, two_sessions: Path
) -> None:
    folder = tmp_path / "results"
    shutil.copytree(two_sessions, folder)
    deep(tmp_path / "deep.toml")
    os.mkfifo(tmp_path / "x.toml")
    result = run("withdraw", folder, "--participant", "01", "--also", tmp_path, typed="01\n")
    assert result.exit_code == 0, result.output
    assert not (folder / "sub-01").exists()


@pytest.mark.parametrize("value", ["=HYPERLINK(1)", "+1", "-1", "@x"])
def test_a_fact_that_a_spreadsheet_would_compute_is_refused(
    value: str, refused: Refused, tmp_path: Path
) -> None:
    study = tmp_path / "study.toml"
    study.write_text(
        STUDY + '[[participants.columns]]\nname = "note"\ndescription = "a note"\n', "utf-8"
    )
    arguments = ("--participant", "01", "--responder", "simulated", "--out", tmp_path / "out")
    assert "note" in refused("run", study, *arguments, "--fact", f"note={value}")


@pytest.mark.parametrize("options", [[], ["--debug"]])
def test_a_fault_of_the_program_is_one_line_and_exit_70(
    options: list[str], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise LookupError("a fault")

    monkeypatch.setattr("experiment.study.files.read_study", fail)
    result = run(*options, "check", tmp_path / "study.toml")
    assert result.exit_code == 70
    assert result.stdout == ""
    *traceback, line = result.stderr.splitlines()
    assert line.startswith("internal error: ")
    assert bool(traceback) is bool(options)


@pytest.mark.parametrize("scheme", ["spy", "alt", "hwgrep", "loop", "cp2110", "http", "file"])
@pytest.mark.parametrize("driver", ["serial", "generator"])
def test_a_port_of_another_scheme_is_refused_before_anything_is_opened(
    scheme: str, driver: str, refused: Refused, tmp_path: Path
) -> None:
    precious = tmp_path / "precious.txt"
    precious.write_text("kept", encoding="utf-8")
    study = tmp_path / "study.toml"
    port = f"{scheme}://x?file={precious}"
    study.write_text(
        f'{STUDY}[device]\ndriver = "{driver}"\namplifier_gain = 20.0\nport = "{port}"\n', "utf-8"
    )
    confirmed = ("--participant", "01", "--confirm-hardware", "--out", tmp_path / "out")
    for arguments in (
        ("check", study),
        ("check", study, "--device", "--confirm-hardware"),
        ("run", study, "--responder", "simulated", *confirmed),
    ):
        assert "device.port" in refused(*arguments)
    message = refused("run", study, "--responder", "simulated", *confirmed, "--port", port)
    assert "--port" in message
    assert precious.read_text("utf-8") == "kept"


def test_a_check_asks_no_name_server(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr("socket.getaddrinfo", lambda *args, **_: asked.append(args))
    study = tmp_path / "study.toml"
    study.write_text(
        f'{STUDY}[device]\ndriver = "serial"\nport = "socket://device.lab:5025"\n', "utf-8"
    )
    assert run("check", study).exit_code in {0, 1}
    assert not asked

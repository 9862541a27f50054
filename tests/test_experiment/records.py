"""Edits of recorded sessions: by somebody who does, or does not, know how they are sealed."""

from __future__ import annotations

import hashlib
import json
import shutil
import zlib
from typing import TYPE_CHECKING, Any, TypeAlias

from experiment import Plan, Trial
from experiment.trial.plan import plan_from_json, seal

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Edit: TypeAlias = Callable[[Path], None]

SESSION = "sub-01/ses-01"


def chained(lines: list[bytes], *, damaged: int = 0) -> bytes:
    """Write journal lines as one would who knows how: numbers, hashes and checksums fit again.

    But for the checksum of a line that is to be damaged.
    """
    written, previous = b"", "0" * 64
    for number, line in enumerate(lines, start=1):
        facts = json.loads(line)
        del facts["crc"]
        facts |= {"seq": number, "prev": previous}
        body = json.dumps(facts, separators=(",", ":"), ensure_ascii=False).encode()
        made = b'{"crc":"%08x",%b' % (zlib.crc32(body) ^ (number == damaged), body[1:])
        previous = hashlib.sha256(made).hexdigest()
        written += made + b"\n"
    return written


def names_of(lines: list[str]) -> list[str]:
    """Return the columns of a table from its lines."""
    return lines[0].rstrip("\n").split(",")


def flip(name: str, share: float) -> Edit:
    """Change one bit of one byte, so far into a file."""

    def edit(results: Path) -> None:
        path = results / SESSION / name
        raw = bytearray(path.read_bytes())
        raw[int(share * (len(raw) - 1))] ^= 1
        path.write_bytes(raw)

    return edit


def rewrite(name: str, change: Callable[[str], str]) -> Edit:
    """Change the text of a file."""

    def edit(results: Path) -> None:
        path = results / SESSION / name
        before = path.read_text("utf-8")
        after = change(before)
        assert after != before
        path.write_bytes(after.encode())

    return edit


def rows(change: Callable[[list[str]], list[str]]) -> Edit:
    """Change the lines of trials.csv."""
    return rewrite("trials.csv", lambda text: "".join(change(text.splitlines(keepends=True))))


def cell(line: int, column: str, value: str) -> Edit:
    def change(lines: list[str]) -> list[str]:
        place = names_of(lines).index(column)
        cells = lines[line - 1].rstrip("\n").split(",")
        cells[place] = value
        return [*lines[: line - 1], ",".join(cells) + "\n", *lines[line:]]

    return rows(change)


def answer(at: int) -> Edit:
    """Turn the answer of a line round, and the verdict, as somebody who knows the table."""

    def change(lines: list[str]) -> list[str]:
        row = dict(zip(names_of(lines), lines[at - 1].rstrip("\n").split(","), strict=True))
        row["response"] = {"left": "right"}.get(row["response"], "left")
        row["correct"] = "true" if row["response"] == row["side"] else "false"
        return [*lines[: at - 1], ",".join(row.values()) + "\n", *lines[at:]]

    return rows(change)


def journal(change: Callable[[list[bytes]], list[bytes]], *, again: bool) -> Edit:
    """Change the lines of the journal, and chain them anew or leave them so."""

    def edit(results: Path) -> None:
        path = results / SESSION / "journal.jsonl"
        lines = change(path.read_bytes().splitlines())
        path.write_bytes(chained(lines) if again else b"".join(one + b"\n" for one in lines))

    return edit


def replaced(event: str, old: bytes, new: bytes) -> Callable[[list[bytes]], list[bytes]]:
    def change(lines: list[bytes]) -> list[bytes]:
        place = next(n for n, one in enumerate(lines) if event.encode() in one and old in one)
        return [*lines[:place], lines[place].replace(old, new, 1), *lines[place + 1 :]]

    return change


def resealed(results: Path) -> None:
    """Draw other levels into the plan, and seal it so that it holds by itself."""
    path = results / SESSION / "plan.json"
    contents = json.loads(path.read_bytes())
    for trial in contents["trials"]:
        if trial["level_vpp"] is not None:
            trial["level_vpp"] += 5.0
    study = json.dumps(contents["study"], sort_keys=True, separators=(",", ":"))
    whole = plan_of(contents, study)
    path.write_text(whole, encoding="utf-8")
    assert plan_from_json(whole).sha256 == json.loads(whole)["sha256"]


def plan_of(contents: dict[str, Any], study: str) -> str:
    made: dict[str, Any] = {name: contents.get(name) for name in Plan.__dataclass_fields__}
    for name in ("trials", "warm_up"):
        made[name] = tuple(Trial(**trial) for trial in contents[name])
    return seal(Plan(**made | {"study": study, "gains": ()})).to_json()


def of_another(name: str) -> Edit:
    def edit(results: Path) -> None:
        shutil.copy(results / "sub-02" / "ses-01" / name, results / SESSION / name)

    return edit


def gone(name: str) -> Edit:
    return lambda results: (results / SESSION / name).unlink()


def heads(change: Callable[[str], str]) -> Edit:
    def edit(results: Path) -> None:
        path = results / "sub-01" / "sessions.tsv"
        path.write_text(change(path.read_text("utf-8")), encoding="utf-8")

    return edit


def without_heads(results: Path) -> None:
    (results / "sub-01" / "sessions.tsv").unlink()


def renamed(results: Path) -> None:
    (results / SESSION).rename(results / "sub-01" / "ses-02")


def heads_of(person: Path) -> dict[str, str]:
    """Return the final hash that sessions.tsv keeps of each session of a person."""
    lines = (person / "sessions.tsv").read_text("utf-8").splitlines()
    rows = [dict(zip(lines[0].split("\t"), line.split("\t"), strict=True)) for line in lines[1:]]
    return {row["session_id"]: row["head_sha256"] for row in rows}

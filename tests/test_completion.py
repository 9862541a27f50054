"""Tab completes words in each shell, by the line that docs/commands.md has for it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from tactstrip import main

pytestmark = pytest.mark.process
PAGE = (Path(__file__).parents[1] / "docs" / "commands.md").read_text(encoding="utf-8")
LINES = {
    shell: line
    for line, shell in re.findall(
        r"^(.*_TACTSTRIP_COMPLETE=(\w+)_source.*?) +# ", PAGE, re.MULTILINE
    )
}
COMMAND = f"""#!/bin/sh
exec "{sys.executable}" -c "from tactstrip import main; main(prog_name='tactstrip')" "$@"
"""
TABS = {
    "bash": """
{line}
COMP_WORDS=({typed}) COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
complete -p tactstrip | grep -qw _tactstrip_completion && _tactstrip_completion tactstrip
printf '%s\\n' "${{COMPREPLY[@]}}"
""",
    "zsh": """
autoload -U compinit && compinit -u -D
{line}
compadd() {{ print -l -- ${{(P)@[-1]}} }}
_describe() {{ print -l -- ${{${{(P)@[-2]}}%%:*}} }}
words=({typed}) CURRENT=$#words
$_comps[tactstrip]
""",
    "fish": """
{line}
complete -C '{typed}' | string split -f 1 \\t
""",
}
"""What a shell does at a Tab, without keys: zsh prints what it would show."""


def completed(shell: str, typed: str, folder: Path) -> list[str]:
    """Return what a shell offers after the line of the page."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is missing")
    command = folder / "tactstrip"
    command.write_text(COMMAND, encoding="utf-8")
    command.chmod(0o755)
    program = TABS[shell].format(line=LINES[shell], typed=typed)
    plain = {"bash": "--norc", "zsh": "-f", "fish": "--no-config"}[shell]
    done = subprocess.run(
        [shell, plain, "-c", program],
        cwd=folder,
        env=os.environ | {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "HOME": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize("shell", TABS)
@pytest.mark.parametrize(("typed", "offered"), [("ver", "verify"), ("check st --js", "--json")])
def test_a_shell_completes_words(shell: str, typed: str, offered: str, tmp_path: Path) -> None:
    assert completed(shell, f"tactstrip {typed}", tmp_path) == [offered]


def test_the_page_has_a_line_for_each_shell_and_the_help_has_that_of_bash() -> None:
    assert [*LINES] == [*TABS]
    assert LINES["bash"] in CliRunner().invoke(main, ["--help"]).output

"""Shell completion: commands, options, and names of files where files are taken."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.usefixtures("plans_shared")


def completed(*words: str) -> list[str]:
    """What bash is reported to complete the last of ``words`` with: type and value of each."""
    done = subprocess.run(
        # click completes for the name that the process was called by
        [sys.executable, "-c", "import sys; sys.argv = ['nutdamp']; from nutdamp.cli import main; main()"],
        env={
            **os.environ,
            "_NUTDAMP_COMPLETE": "bash_complete",
            "COMP_WORDS": " ".join(("nutdamp", *words)),
            "COMP_CWORD": str(len(words)),
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize(
    "words",
    [
        "plan sp",
        "check a.yaml sp",
        "init sp",
        "import apm sp",
        "simulate --schedule pul",
        "plan --csv out",
        "plan --json out",
        "plan --plot out",
        "report -o out",
        "schema --output out",
    ],
)
def test_names_of_files_are_left_to_the_shell(words: str) -> None:
    assert completed(*words.split()) == [f"file,{words.split()[-1]}"]


def test_names_of_folders_too() -> None:
    assert completed("trade", "--schedules", "out") == ["dir,out"]


def test_commands_options_and_choices_are_completed() -> None:
    assert completed("ver") == ["plain,verify"]
    assert completed("plan", "--targ") == ["plain,--target"]
    assert completed("plan", "--scheme", "two") == ["plain,two-pulse"]
    assert completed("init", "--from", "lun") == ["plain,lunar-prospector"]


def test_every_file_of_every_command_is_completed() -> None:
    import click

    from nutdamp.cli.parameters import FileName
    from nutdamp.cli.root import group

    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        for parameter in command.params:
            if parameter.name in ("spacecraft", "files", "file", "csv", "json", "plot", "output", "schedule"):
                assert isinstance(parameter.type, FileName), f"{name}: {parameter.name}"

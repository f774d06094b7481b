"""``--set KEY=VALUE`` on every command that reads a spacecraft."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import pytest
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

COMMANDS = {
    "plan": (),
    "simulate": ("--scheme", "none"),
    "trade": (),
    "disperse": ("--samples", "10"),
    "verify": (),
    "loop": (),
    "budget": (),
    "report": ("-o", "-"),
    "animate": ("-o", "x.gif"),
    "check": (),
    "export": ("--format", "json"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_reads_a_spacecraft_sets(run: Run, command: str) -> None:
    """A fault of a setting reaches the user from each of them, so each of them reads it."""
    done = run(command, *COMMANDS[command], "--set", "limits.horizn=3 s", "--set", "mass=-1 kg")
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert "--set limits.horizn=3 s: limits.horizn: unknown key; did you mean 'horizon'?" in lines
    assert any(line.startswith("--set mass=-1 kg: mass: '-1 kg' is out of range") for line in lines)
    assert "--set KEY=VALUE" in run(command, "--help").stdout


def test_what_is_set_is_planned(run: Run) -> None:
    done = run("plan", "-q", "--set", "state.nutation=8 deg", "--set", "limits.horizon=300s", "--json", "-")
    assert done.returncode == 0
    assert json.loads(done.stdout)["spacecraft"]["nutation_deg"] == pytest.approx(8.0)


def test_all_files_of_a_check_are_set(run: Run, tmp_path: Path) -> None:
    for name in ("a.yaml", "b.yaml"):
        run("init", name)
    done = run("check", "a.yaml", "b.yaml", "--set", "state.spin=31 rpm")
    assert done.stdout.count("31 rpm") == 2
    done = run("check", "a.yaml", "--set", "mass=0", "--json", "-")
    (fault,) = json.loads(done.stdout)["files"][0]["faults"]
    assert (fault["line"], fault["column"], fault["where"]) == (None, None, "mass")
    assert fault["place"].startswith("--set mass=")


def test_what_is_no_setting_is_a_usage_error(run: Run) -> None:
    done = run("plan", "--set", "mass")
    assert done.returncode == 2
    assert "Invalid value for '--set': 'mass' is not KEY=VALUE" in done.stderr


@pytest.mark.weekly
def test_a_report_shows_what_was_set(run: Run) -> None:
    page = run("report", "-o", "-", "-q", "--scheme", "two-pulse", "--set", "state.nutation=8 deg").stdout
    assert "damping 8 deg" in page
    assert "Set in place of what the file says" in page
    assert "--set 'state.nutation=8 deg'" in html.unescape(re.sub("<[^>]+>", "", page))
    assert page.count("state.nutation") >= 2

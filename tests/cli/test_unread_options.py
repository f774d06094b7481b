"""No option is ignored in silence: what does nothing is told, what contradicts is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from process import Run


@pytest.mark.parametrize(
    ("command", "option", "reader"),
    [
        ("plan --scheme one-pulse --least time", "--least", "optimal"),
        ("plan --scheme two-pulse --on-time 200ms", "--on-time", "four-pulse"),
        ("plan --scheme four-pulse --literal", "--literal", "two-pulse"),
        ("plan --shift 0.2deg", "--shift", "optimal"),
        ("simulate --scheme none --coarse", "--coarse", "four-pulse"),
        ("verify --scheme two-pulse --free-axis", "--free-axis", "optimal"),
        ("trade --points 1 --allow any --on-time 1s", "--on-time", "four-pulse"),
        ("report -o x.md --scheme one-pulse --coarse", "--coarse", "four-pulse"),
    ],
)
def test_an_option_that_no_scheme_planned_reads_is_told(run: Run, command: str, option: str, reader: str) -> None:
    done = run(*command.split())
    (told,) = [line for line in done.stderr.splitlines() if "does nothing here" in line]
    assert told.startswith(option)
    assert reader in told
    assert "does nothing here" not in run(*command.split(), "--quiet").stderr


@pytest.mark.parametrize(
    "command", ["plan --on-time 700ms", "plan --literal", "plan --scheme optimal --shift 0.2deg", "plan"]
)
def test_an_option_that_one_scheme_reads_is_no_matter(run: Run, command: str) -> None:
    assert "does nothing" not in run(*command.split()).stderr


def test_an_option_beside_a_schedule_is_told(run: Run, tmp_path: Path) -> None:
    run("plan", "--csv", "pulses.csv")
    done = run("simulate", "--schedule", "pulses.csv", "--coarse")
    assert done.returncode == 0
    assert "--coarse does nothing here" in done.stderr


def test_a_scheme_that_cannot_set_the_spin_is_infeasible(run: Run) -> None:
    done = run("plan", "--spin", "31rpm")
    assert done.returncode == 3
    assert "one-pulse, two-pulse, four-pulse: cannot set the spin; optimal can" in done.stdout
    done = run("simulate", "--scheme", "two-pulse", "--spin", "31rpm")
    assert done.returncode == 3
    assert "two-pulse is infeasible: cannot set the spin" in done.stderr
    assert run("simulate", "--scheme", "none", "--spin", "31rpm").returncode == 0
    assert run("plan", "--spin", "keep").returncode == 0


def test_a_direction_of_the_sun_that_nothing_reads_is_told(run: Run) -> None:
    command = ("plan", "--target", "10deg,45deg", "--sun", "70deg,0deg", "--scheme")
    assert "--sun does nothing here: it is for rhumb-line" in run(*command, "half-cone").stderr
    assert "does nothing" not in run(*command, "rhumb-line").stderr


@pytest.mark.parametrize(
    ("command", "cure"),
    [
        ("plan --scheme optimal --shift=-1deg", "at least 0"),
        ("plan --scheme optimal --shift 1deg --free-axis", "expected none beside a free axis"),
        ("trade --shift 1deg", "--allow"),
        ("trade --free-axis", "--allow"),
        ("trade --least time", "propellant or impulse"),
        ("plan --figure motion", "--plot"),
        ("simulate --scheme none --figure motion", "--plot"),
    ],
)
def test_options_that_contradict_are_refused(run: Run, command: str, cure: str) -> None:
    done = run(*command.split())
    assert (done.returncode, done.stdout) == (2, "")
    assert cure in done.stderr

"""No option is ignored in silence: what does nothing is reported, what contradicts is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.process import Run

from nutdamp.cli.root import COMMANDS

pytestmark = pytest.mark.usefixtures("plans_shared")


@pytest.mark.parametrize(
    ("command", "option", "reader"),
    [
        ("plan --scheme one-pulse --least time", "--least", "optimal"),
        ("plan --scheme two-pulse --on-time 200ms", "--on-time", "four-pulse"),
        ("plan --scheme four-pulse --literal", "--literal", "two-pulse"),
        ("plan --scheme two-pulse --shift 0.2deg", "--shift", "optimal"),
        ("plan --scheme half-cone --target 10deg,45deg --per-turn 2", "--per-turn", "rhumb-line"),
    ],
)
def test_an_option_that_no_scheme_planned_reads_is_reported(run: Run, command: str, option: str, reader: str) -> None:
    done = run(*command.split())
    (reported,) = [line for line in done.stderr.splitlines() if "does nothing here" in line]
    assert reported.startswith(option)
    assert reader in reported
    assert "does nothing here" not in run(*command.split(), "--quiet").stderr


@pytest.mark.parametrize("command", ["plan --on-time 700ms", "plan --literal", "plan --shift 0.2deg", "plan"])
def test_an_option_that_one_scheme_reads_is_no_matter(run: Run, command: str) -> None:
    assert "does nothing" not in run(*command.split()).stderr


@pytest.mark.parametrize(
    ("command", "option", "schedule"),
    [
        ("simulate --scheme four-pulse --coarse", "--coarse is for four-pulse, an option of `nutdamp plan`", True),
        ("verify --on-time 200ms", "--on-time is for four-pulse and rhumb-line, an option of `nutdamp plan`", True),
        ("disperse --literal", "--literal is for two-pulse, an option of `nutdamp plan`", True),
        ("animate -o x.gif --cones 3", "--cones is for half-cone, an option of `nutdamp plan`", True),
        ("export --format json --free-axis", "--free-axis is for optimal, an option of `nutdamp plan`", True),
        ("report --per-turn 2", "--per-turn is for rhumb-line, an option of `nutdamp plan`", False),
        ("trade --shift 1deg", "--shift is for optimal, an option of `nutdamp plan`", False),
    ],
)
def test_an_option_of_a_scheme_is_given_to_plan(run: Run, command: str, option: str, schedule: bool) -> None:
    done = run(*command.split())
    assert (done.returncode, done.stdout) == (2, "")
    assert option in done.stderr
    assert ("save its pulses with --csv FILE, and name them here with --schedule FILE" in done.stderr) == schedule


@pytest.mark.parametrize("command", COMMANDS)
def test_a_help_page_fits_the_screen_of_a_terminal(run: Run, command: str) -> None:
    lines = run(command, "--help").stdout.splitlines()
    assert len(lines) <= 60
    assert max(map(len, lines)) <= 80


def test_trade_shows_no_option_that_it_does_not_read(run: Run) -> None:
    """No scheme of a front reads the Sun, and none is left out of it for a bug."""
    shown = run("trade", "--help").stdout
    assert "--target" in shown
    assert "--sun" not in shown
    assert "--debug" not in shown


def test_a_scheme_that_cannot_set_the_spin_is_infeasible(run: Run) -> None:
    done = run("plan", "--spin", "31rpm")
    assert done.returncode == 3
    assert "one-pulse, two-pulse, four-pulse: cannot set the spin; optimal can" in done.stdout
    done = run("simulate", "--scheme", "two-pulse", "--spin", "31rpm")
    assert done.returncode == 3
    assert "two-pulse is infeasible: cannot set the spin" in done.stderr
    assert run("simulate", "--scheme", "none", "--spin", "31rpm").returncode == 4
    assert run("plan", "--spin", "keep").returncode == 0


def test_a_direction_of_the_sun_that_nothing_reads_is_refused(run: Run, tmp_path: Path) -> None:
    run("plan", "--csv", "pulses.csv")
    aim = ("--target", "10deg,45deg")
    for command in (
        ("plan", "--scheme", "half-cone", *aim),
        ("plan",),
        ("simulate", "--scheme", "two-pulse", *aim),
        ("simulate", "--schedule", "pulses.csv"),
        ("trade", "--points", "1", *aim),
        ("report", "--scheme", "optimal", *aim),
    ):
        done = run(*command, "--sun", "70deg,0deg")
        assert (done.returncode, done.stdout) == (2, "")
        assert "--sun is for rhumb-line, which is not planned here" in done.stderr


@pytest.mark.deep
def test_of_schemes_that_do_not_read_the_sun_it_is_reported(run: Run) -> None:
    command = ("plan", "--target", "10deg,45deg", "--sun", "70deg,0deg", "--scheme", "rhumb-line")
    assert run(*command).stderr == "no spacecraft file named, and no spacecraft.yaml here: " + (
        "using the built-in example (see `nutdamp init`)\n"
    )
    done = run(*command, "--scheme", "half-cone", "--scheme", "two-pulse")
    assert done.returncode == 0
    assert "--sun is read by rhumb-line alone: half-cone, two-pulse plan without it" in done.stderr


@pytest.mark.parametrize("scheme", ["half-cone", "rhumb-line"])
@pytest.mark.parametrize("command", ["plan", "simulate", "verify", "export --format json", "report"])
def test_what_turns_to_a_target_is_refused_without_one(run: Run, command: str, scheme: str) -> None:
    done = run(*command.split(), "--scheme", scheme)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{scheme} turns the spin axis to a target and needs one: --target, or goal in the file" in done.stderr


def test_beside_others_it_is_one_column_that_says_so(run: Run) -> None:
    done = run("plan", "--scheme", "half-cone", "--scheme", "two-pulse")
    assert done.returncode == 0
    assert "half-cone: needs a target axis" in done.stdout
    both = run("plan", "--scheme", "half-cone", "--scheme", "rhumb-line")
    assert both.returncode == 2
    assert "half-cone and rhumb-line turn the spin axis to a target and need one" in both.stderr

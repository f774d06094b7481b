"""A scheme that has a bug: the comparison goes on, says so, and leaves with 1."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from nutdamp.cli.root import group
from nutdamp.schedule import Schedule
from nutdamp.schemes import two_pulse

pytestmark = pytest.mark.usefixtures("plans_shared")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    def broken(*_: object) -> Schedule:
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setattr(two_pulse, "schedule", broken)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_rest_of_the_comparison_is_shown(folder: Path) -> None:
    done = CliRunner().invoke(group, ["plan", "--json", "plan.json", "--csv", "pulses.csv"])
    assert done.exit_code == 1
    for text in ("internal error,", "please report:", "ZeroDivisionError", "Recommended: optimal"):
        assert text in done.stdout
    assert "two-pulse: internal error, please report: ZeroDivisionError (--debug shows" in done.stderr
    assert "Traceback" not in done.output
    one, two, four, _ = json.loads((folder / "plan.json").read_text())["plans"]
    assert (one["feasible"], two["feasible"], four["feasible"]) == (True, False, True)
    assert two["why"] == "internal error, please report: ZeroDivisionError"
    assert (folder / "pulses.csv").exists()


def test_the_traceback_is_shown_on_demand(folder: Path) -> None:
    done = CliRunner().invoke(group, ["plan", "--debug"])
    assert done.exit_code == 1
    assert "Traceback" in done.stderr
    assert "ZeroDivisionError: float division by zero" in done.stderr


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_the_page_is_written(folder: Path) -> None:
    done = CliRunner().invoke(group, ["report"])
    assert done.exit_code == 1
    assert "ZeroDivisionError" in (folder / "report.html").read_text(encoding="utf-8")


def test_a_scheme_that_fails_alone_recommends_nothing(folder: Path) -> None:
    done = CliRunner().invoke(group, ["plan", "--scheme", "two-pulse"])
    assert done.exit_code == 1
    assert "please report:" in done.stdout
    assert "No recommendation" in done.stdout


@pytest.mark.deep
def test_robust_plans_go_on_without_it(folder: Path) -> None:
    done = CliRunner().invoke(group, ["plan", "--robust", "--scheme", "two-pulse", "--scheme", "four-pulse"])
    assert done.exit_code == 1
    assert "Robust plan: four-pulse" in done.stdout
    assert "two-pulse: internal error, please report: ZeroDivisionError" in done.stdout

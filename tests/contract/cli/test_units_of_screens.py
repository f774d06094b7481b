"""``--units us``: no number of a screen stays in SI where its dimension has a US unit; files are SI all the same."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from support.cases import deep, spread
from support.commands import call
from support.places import CASES, CONFIGS
from support.process import Run

from nutdamp.files.reader import example_text

pytestmark = pytest.mark.usefixtures("plans_shared")

PAIRS = {
    "kg m²": ("slug ft²", 1.3558179483314), "kg": ("lbm", 0.45359237), "g": ("lbm", 453.59237),
    "N m s": ("ft lbf s", 1.3558179483314), "N m": ("ft lbf", 1.3558179483314), "N s": ("lbf s", 4.4482216152605),
    "N": ("lbf", 4.4482216152605), "mm": ("in", 25.4), "m": ("ft", 0.3048), "bar": ("psi", 0.068947572931684),
}  # fmt: skip
"""Units of SI, those of US screens, and how many of the former one of the latter is (NIST SP 811)."""


def units(names: list[str]) -> re.Pattern[str]:
    """Pattern of a unit, behind a number of its own or not: no part of a word, nor of a name such as "+M1"."""
    words = "|".join(sorted(names, key=len, reverse=True))
    return re.compile(rf"(?:(-?[0-9.]+(?:e-?[0-9]+)?) )?(?<![\w°µ'|.+-])({words})((?:/\w+²?)?)(?![\w|²'-]| s\b)")


SI_UNITS, US_UNITS = units(list(PAIRS)), units([name for name, _ in PAIRS.values()])

FILES = [path.stem for path in sorted(CONFIGS.glob("*.yaml"))]
LOOPED, DISPERSED = (
    [name for name in FILES if key in (CONFIGS / f"{name}.yaml").read_text(encoding="utf-8")]
    for key in ("\nloop:", "\ndispersions:")
)
SHORT = ["check -v", "simulate -v --scheme two-pulse --samples 100"]
LONG = [
    "plan --nominal", "plan -v --nominal", "simulate -v --scheme optimal", "verify -v --scheme two-pulse",
    "trade -v --points 2",
]  # fmt: skip
STUDIES = ["disperse --scheme two-pulse --case 3", "disperse -v --samples 500 --scheme two-pulse"]
LOOPS = [
    "loop -v --until 400s", "budget -v", "disperse -v --loop --samples 50", "disperse --loop --samples 9 --case 3",
    "verify --loop --set limits.horizon=300s",
]  # fmt: skip
FITS = [f"fit -v {CASES}/{name}.csv {CASES}/{name}.yaml" for name in ("accelerometer", "axis-tumble")]


def of_configs(commands: list[str], names: list[str]) -> list[str]:
    """Each of the commands with each of the files."""
    return [f"{command} {CONFIGS}/{name}.yaml" for command in commands for name in names]


def expect_replaced(run: Run, command: str) -> None:
    """Each unit is replaced, and each number with one is its value in the other."""
    si, us = (call(run, f"{command} --units {name}", columns=200) for name in ("si", "us"))
    assert (us.returncode, si.stdout) == (si.returncode, call(run, command, columns=200).stdout)
    texts = [ended.stdout + ended.stderr for ended in (si, us)]
    assert not SI_UNITS.findall(texts[1])
    # "in" is a word as well.
    before = [match for match in SI_UNITS.findall(texts[0]) if match[1] != "mm"]
    after = [match for match in US_UNITS.findall(texts[1]) if match[1] != "in"]
    assert before or si.returncode == 3  # nothing is feasible
    assert len(before) == len(after)
    for (number, unit, per), (other, us_unit, us_per) in zip(before, after, strict=True):
        name, factor = PAIRS[unit]
        assert (us_unit, us_per, bool(other)) == (name, per, bool(number))
        if number:
            assert math.isclose(float(number), factor * float(other), rel_tol=6e-3, abs_tol=1e-9)


@spread("command", [*of_configs(SHORT, FILES), *of_configs(STUDIES, DISPERSED)], quick=4, deep=8)
def test_no_si_unit_with_a_us_one_is_left_on_a_screen(run: Run, command: str) -> None:
    expect_replaced(run, command)


@pytest.mark.weekly
@pytest.mark.parametrize("command", [*of_configs(LONG, FILES), *of_configs(LOOPS, LOOPED), *FITS])
def test_nor_on_the_screens_of_long_studies(run: Run, command: str) -> None:
    expect_replaced(run, command)


def test_tanks_and_tolerances_are_shown_in_us_units(run: Run, tmp_path: Path) -> None:
    """Pressure and propellant of a tank, and tolerances in their own units."""
    (tmp_path / "s.yaml").write_text(
        example_text() + "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar}\n", encoding="utf-8"
    )
    shown = run("check", "s.yaml", "-v", "--units", "us", "--set", "mass=250 kg", columns=120).stdout
    assert re.search(r"^0 +319.1 psi", shown, re.MULTILINE)
    assert re.search(r"^66.14 +116 psi", shown, re.MULTILINE)
    assert not SI_UNITS.findall(shown)


@pytest.mark.parametrize("command", [
    "check --json FILE", "simulate --scheme two-pulse --csv FILE", "plan --scheme two-pulse --nominal --json FILE",
    deep("disperse --scheme two-pulse --samples 9 --json FILE"),
])  # fmt: skip
def test_files_are_si(run: Run, tmp_path: Path, command: str) -> None:
    for units in ("si", "us"):
        call(run, command.replace("FILE", units) + f" -q --units {units}")
    assert (tmp_path / "us").read_bytes() == (tmp_path / "si").read_bytes()


def test_reasons_without_a_plan_have_no_units(run: Run) -> None:
    """A torquer too weak for half the nutation."""
    weak = call(run, "plan -v --scheme two-pulse --set steerable.torque=0.1 --set thrusters=[] --units us -q")
    assert weak.returncode == 3
    assert "infeasible" in weak.stdout
    assert not SI_UNITS.findall(weak.stdout)

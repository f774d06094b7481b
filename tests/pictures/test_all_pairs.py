"""Reports and pictures of every spacecraft with every option, in pairs: nothing breaks, and a file is written."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from support import pairwise, places
from support.cases import deep, weekly
from support.process import Run
from support.smoke import BEGINNINGS

pytestmark = pytest.mark.usefixtures("plans_shared")

FILES = tuple(sorted(path.stem for path in places.CONFIGS.glob("*.yaml")))
DISPERSED = {name for name in FILES if "\ndispersions:" in (places.CONFIGS / f"{name}.yaml").read_text("utf-8")}
SPINS = {"couples-minisat": "--spin=-10rpm", "despun-comsat": ""}
"""Spins of those that turn the other way, or do not turn at all."""

TOLERANCES = "--set 'dispersions.omega0={normal: 0.05 deg/s}'"
"""Of the files that have none."""

CASES = ("", "--nominal", "--disperse 300", "--robust", "--robust --disperse 3000")
GOALS = ("", "--spin 10rpm", "--spin keep", "--target 10deg,45deg")
SCHEMES = ("", "--scheme two-pulse", "--scheme four-pulse", "--scheme optimal")
PAGES = ("", "--trade 2", "--with-disturbances", "--title T --document D --issue 1 --author A --date 2026-03-01")
SAVED = ("", "--least time", "--least pulses", "--least impulse", "--free-axis", "--shift 1deg", "--timed")
DRAWN = ("--plot p.png", "--figure motion --plot p.svg", "--plot p.pdf")
OTHERS = (
    "simulate --plot p.png",
    "simulate --flown --figure motion --plot p.svg",
    "simulate --scheme none --until 30s --plot p.svg",
    *(f"disperse --samples 300 --figure {name} --plot p.svg" for name in ("overview", "cases", "momentum")),
    "trade --points 2 --plot p.png",
    "trade --points 2 --allow any --plot p.pdf",
)
FIRST = (("genesis", "", "--spin 10rpm", "", ""), ("single-thruster", "--robust --disperse 3000", "", "", ""))
"""Reports that broke."""

TABLES = {
    "report -o page.html": ((FILES, CASES, GOALS, SCHEMES, PAGES), FIRST),
    "plan": ((FILES, ("", "--nominal", "--robust"), GOALS, SCHEMES, DRAWN, SAVED), ()),
    "": ((FILES, OTHERS, GOALS), ()),
}
"""Factors of each command, and rows that are among them."""

DEEP = 4
"""Rows of each table that run in CI: the first ones by name, others evenly spread."""


def listed() -> Iterator[Any]:
    """All commands, as parameters of a test."""
    for command, (factors, first) in TABLES.items():
        rows = pairwise.rows(factors, first)
        every = len(rows) // (DEEP - len(first))
        for number, (name, *options) in enumerate(rows):
            words = " ".join(filter(None, (command, *options)))
            words = re.sub(r"--spin \S+", SPINS.get(name, r"\g<0>"), words)
            called, *rest = words.split(" ", 1)
            flown = name in DISPERSED or not re.search("robust|disperse", words)
            text = " ".join([called, f"{name}.yaml", *rest, *[TOLERANCES] * (not flown)])
            yield (deep if number < len(first) or number % every == every // 2 else weekly)(text)


@pytest.mark.parametrize("command", [*listed()])
def test_a_file_is_written_whatever_meets(run: Run, tmp_path: Path, command: str) -> None:
    name = command.split()[1]
    (tmp_path / name).write_bytes((places.CONFIGS / name).read_bytes())
    done = run(*shlex.split(command))
    assert done.returncode in (0, 3, 4), done.stderr
    assert "internal error" not in done.stdout + done.stderr
    written = tmp_path / re.findall(r"(?:-o|--plot) (\S+)", command)[0]
    if written.exists() or done.returncode != 3 or command.startswith("report"):
        assert written.read_bytes().lower().startswith(BEGINNINGS[written.suffix].lower())


def test_any_two_options_meet() -> None:
    for factors, first in TABLES.values():
        rows = pairwise.rows(factors, first)
        assert rows[: len(first)] == [*first]
        for one, other in combinations(range(len(factors)), 2):
            pairs = {(row[one], row[other]) for row in rows}
            assert pairs == {(a, b) for a in factors[one] for b in factors[other]}
        assert len(rows) <= 1.3 * len(factors[0]) * max(map(len, factors[1:]))

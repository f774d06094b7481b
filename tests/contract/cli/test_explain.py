"""``nutdamp explain``: every topic prints what it is for, at any width, and loads nothing heavy."""

from __future__ import annotations

import csv
import itertools
import math
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner
from support.process import Run

from nutdamp import guide
from nutdamp.cli.root import group
from nutdamp.cli.scheme_options import SHARED
from nutdamp.files.file_guide import flow, keys
from nutdamp.files.schema import json_schema
from nutdamp.files.settings import parse_setting
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.guide.equation import EQUATIONS, SYMBOLS, Equation
from nutdamp.guide.topic import Commands, Formula
from nutdamp.presentation.explain_tables import WIDEST
from nutdamp.schemes import NAMES, SCHEMES
from nutdamp.schemes.options import names_of
from nutdamp.tolerances import KINDS as TOLERANCE_KINDS
from nutdamp.units import KINDS

pytestmark = pytest.mark.usefixtures("plans_shared")

FIGURES = guide.found("figures")
TOPICS = (*guide.NAMES, *(one.number for one in EQUATIONS), "file.thrusters", "file.limits.tick")


def explained(*arguments: str, columns: int = 80) -> str:
    """What the command prints, without a process of its own."""
    done = CliRunner().invoke(group, ["explain", *arguments], env={"COLUMNS": str(columns), "NO_COLOR": "1"})
    assert done.exit_code == 0, done.output
    return done.stdout


def words(text: str) -> str:
    """The text without its line breaks."""
    return " ".join(text.split())


def test_every_topic_is_listed() -> None:
    shown = words(explained())
    for _, topics in guide.SUMMARIES:
        for name, summary in topics:
            assert f"{name} {summary}" in shown
    assert set(NAMES) <= set(guide.NAMES)
    assert {"nutation", "file", "units", "figures", "equations", "17"} <= set(guide.NAMES)


@pytest.mark.parametrize("topic", TOPICS)
def test_each_topic_fits_the_screen_and_loses_nothing(topic: str) -> None:
    whole = words(explained(topic, columns=300)).replace(" \\", "")
    assert len(whole) > 150
    for columns in (36, 80, 140):
        shown = explained(topic, columns=columns)
        assert max(map(len, shown.splitlines())) <= min(columns, WIDEST)
        assert words(shown).replace(" \\", "").replace(" ", "") == whole.replace(" ", "")


@pytest.mark.parametrize("scheme", NAMES)
def test_a_scheme_says_how_when_with_which_options_and_within_what_limits(scheme: str) -> None:
    shown = explained(scheme)
    options = "Options" if scheme == "none" else "Options of nutdamp plan"  # the other commands take none of them
    for title in ("How it works", "Equation", "When to use it", options, "Limits"):
        assert f"\n{title}\n" in shown
    mine = names_of(SCHEMES[scheme].options)
    for option in {name for other in SCHEMES.values() for name in names_of(other.options)} - set(SHARED):
        assert (f"--{option.replace('_', '-')}" in shown) == (option in mine), option


@pytest.mark.parametrize(
    "equation", [one for one in EQUATIONS if one.number != "energy sink"], ids=lambda one: str(one.number)
)
def test_an_equation_has_its_formula_its_symbols_and_what_is_changed(equation: Equation) -> None:
    shown = words(explained(equation.number))
    lines = list(equation.formula.lines)
    for block in equation.changed:
        lines += block.lines if isinstance(block, Formula) else [str(block)]
    for line in lines:
        assert words(line) in shown
    for symbol in equation.symbols:
        assert f"{symbol} {SYMBOLS[symbol]}" in shown
        assert symbol.strip("'").removesuffix("(t)") in " ".join(lines)
    assert equation.place in shown


def test_all_equations_at_a_glance() -> None:
    shown = words(explained("equations"))
    for one in EQUATIONS:
        assert f"{one.number} {one.subject}: {one.place}" in shown


@pytest.mark.parametrize(
    ("requested", "number"),
    [("17", "M(17)"), ("m17", "M(17)"), ("(17)", "M(17)"), ("M 17", "M(17)"), ("k7", "K(7)"), ("K(7)", "K(7)"),
     ("24.4", "24.4"), ("§24.4", "24.4")],
)  # fmt: skip
def test_numbers_as_people_write_them(requested: str, number: str) -> None:
    assert guide.found(requested).name == number


@pytest.mark.parametrize("requested", ["Abb. 5", "abb8", "fig. 6", "Figures", "FIGURES"])
def test_figures_as_people_write_them(requested: str) -> None:
    assert guide.found(requested) is FIGURES


@pytest.mark.parametrize(
    ("requested", "hint"),
    [
        ("tow-pulse", "did you mean 'two-pulse'?"),
        ("nutaton", "did you mean 'nutation'?"),
        ("unit", "did you mean 'units'?"),
        ("28", "there is no equation M(28); there are M(1) to M(27), K(5) to K(15) and 24.4"),
        ("K4", "there is no equation K(4)"),
        ("file.thruster", "did you mean 'file.thrusters'?"),
        ("file.horizon", "did you mean 'file.limits.horizon'?"),
        ("file.qqq.zzz", "`nutdamp explain file` lists them"),
        ("weather", "`nutdamp explain` lists them"),
    ],
)
def test_what_there_is_not_says_what_is_near(run: Run, requested: str, hint: str) -> None:
    done = run("explain", requested)
    assert done.returncode == 2
    assert done.stdout == ""
    assert hint in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_every_key_of_the_models_is_in_the_file_topic() -> None:
    """With its description, unit and example; and each can be requested alone."""
    shown = words(explained("file"))
    every = list(keys())
    schema = json_schema()
    names = set(schema["properties"]).union(*(section["properties"] for section in schema["$defs"].values()))
    assert {key.name for key in every} == names | set(TOLERANCE_KINDS)
    for key in every:
        assert words(" ".join(key.row)) in shown, key.path
        assert key.field.description
        assert key.field.examples
    alone = words(explained("file.dispersions.thrust"))
    assert "unit N, mN or %" in alone
    assert "normal One sigma" in alone


def test_units_and_defaults_of_keys() -> None:
    rows = {key.path: words(key.row[1]) for key in keys()}
    assert rows["limits.horizon"].endswith("default: 20 nutation periods. unit s, ms, min or hours; example: 120 s")
    assert rows["state.spin"].endswith("unit rad/s, deg/s or rpm; required; example: 30 rpm")
    assert rows["thrusters.force"] == "Thrust, N. unit N or mN; default none; example: 10 N"
    assert "EME2000, J2000 or GCRF; default none" in rows["attitude.frame"]
    assert "plain numbers, without unit; required" in rows["attitude.quaternion"]
    assert "a whole number; example: 8" in rows["limits.max_pulses"]
    assert "unit kg m^2 or %; default none; example: {normal: 2 %}" in rows["dispersions.A"]


def test_examples_can_be_set() -> None:
    """As --set takes them, on a file that has what they need."""
    base = "name: x\ninertia: {A: 100, C: 80}\nomega0: [0.1, 0, 3]\nthrusters:\n"
    for name, torque in (("T1", "[0, 8, 0]"), ("T2", "[8, 0, 0]")):
        base += f"  - {{name: {name}, torque: {torque}, lever_arm: 1, isp: 220}}\n"
    base += "attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: GCRF}\n"
    base += "sun: epoch\nsun_sensor: {azimuth: 0}\n"
    chosen = [key for key in keys() if not key.parent and key.name not in ("state", "omega0")]
    assert len(chosen) > 10
    for key in chosen:
        example = (key.field.examples or [None])[0]
        if key.name == "channels":
            example = {"+M1": ["T1", "T2"]}
        read_spacecraft(base, "f.yaml", [parse_setting(f"{key.path}={flow(example)}")])


def test_every_unit_is_in_the_units_topic() -> None:
    lines = explained("units").splitlines()
    for kind in KINDS.values():
        (line,) = (line for line in lines if line.startswith(f"{kind.noun.partition(' ')[2]}  "))
        for unit, factor in kind.factors.items():
            assert re.search(rf"(?<!\S){re.escape(unit)}(?=[; ]|$)", line), unit
            if factor != 1.0:
                shown = float(re.findall(rf"(?<!\S){re.escape(unit)} = (\S+?)(?: |;|$)", line)[0])
                assert shown == pytest.approx(factor, rel=1e-5)


DRAWN = [
    parts for part in FIGURES.parts for block in part.blocks if isinstance(block, Commands) for parts in block.lines
]


def test_the_figures_of_magnus_are_all_there() -> None:
    titles = " ".join(part.title for part in FIGURES.parts)
    assert set(re.findall(r"Abb\. (\d)", titles)) == {"2", "4", "5", "6", "7", "8"}


@pytest.mark.deep
@pytest.mark.parametrize("name", ["abb6.png", "abb4.gif"])
def test_the_commands_of_the_figures_draw(run: Run, tmp_path: Path, name: str) -> None:
    """One of each kind; what the others draw is flown below."""
    pytest.importorskip("matplotlib")
    command = shlex.split(" ".join(command_of(name)))
    small = ["--seconds", "0.2", "--fps", "5", "--width", "320"] if command[1] == "animate" else []
    done = run(*command[1:], *small)
    assert done.returncode == (4 if command[1] == "plan" else 0), done.stderr  # full pulses miss the requirement
    assert (tmp_path / name).stat().st_size > 1000


def test_the_commands_of_the_figures_differ_in_the_motion_alone() -> None:
    for parts in DRAWN:
        first, *_, figure, plot = parts
        if first in ("nutdamp simulate", "nutdamp plan"):
            assert figure == "--figure motion"
            assert re.fullmatch(r"--plot \w+\.png", plot)
        else:
            assert first == "nutdamp animate"


def track(run: Run, tmp_path: Path, parts: tuple[str, ...]) -> list[dict[str, float]]:
    """The track of a figure's command, in place of its picture."""
    command = shlex.split(" ".join(parts))[1:]
    for option in ("--figure", "--plot"):
        del command[command.index(option) : command.index(option) + 2]
    if command[0] == "plan":
        assert run(*command, "--csv", "pulses.csv").returncode in (0, 4)
        command = ["simulate", *command[1:3], "--schedule", "pulses.csv"]
    done = run(*command, "--csv", "track.csv")
    assert done.returncode in (0, 4), done.stderr  # full pulses miss the requirement
    with (tmp_path / "track.csv").open(encoding="utf-8") as stream:
        return [{name: float(value or "nan") for name, value in row.items()} for row in csv.DictReader(stream)]


def command_of(name: str) -> tuple[str, ...]:
    return next(parts for parts in DRAWN if name in parts[-1])


@pytest.mark.parametrize(("name", "a"), [("abb6", 0.9), ("abb7", 0.3), ("oblate", -0.3)])
def test_abb_5_to_7_show_what_the_source_shows(run: Run, tmp_path: Path, name: str, a: float) -> None:
    """At least two rounds of four pulses a quarter turn apart, inwards; the axis turns by 90° (1 - a)/|a| between."""
    rows = track(run, tmp_path, command_of(name))
    jumps = [(left, right) for left, right in itertools.pairwise(rows) if right["pulse"] > left["pulse"]]
    before, after = ([pair[side] for pair in jumps] for side in (0, 1))
    assert len(jumps) >= 8
    for left, right in zip(after[:-1], before[1:], strict=True):
        ends = [complex(row["omega_1_rad_s"], row["omega_2_rad_s"]) for row in (left, right)]
        assert math.degrees(math.atan2((ends[1] / ends[0]).imag, (ends[1] / ends[0]).real)) == pytest.approx(
            -math.copysign(90.0, a), abs=1e-6
        )
    # the rate of the nutation in space at small angles, over a quarter of the period in the body
    spin = rows[0]["omega_3_rad_s"]
    turned = math.degrees((1.0 - a) * spin * (before[2]["t_s"] - before[1]["t_s"]))
    assert turned == pytest.approx(90.0 * (1.0 - a) / abs(a), rel=1e-6)
    assert rows[-1]["nutation_deg"] < 0.1 * rows[0]["nutation_deg"]


def test_abb_8_stops_the_axis_where_h_was(run: Run, tmp_path: Path) -> None:
    rows = track(run, tmp_path, command_of("abb8"))
    assert rows[-1]["pulse"] == 2
    start, end = ([row[f"momentum_{axis}_Nms"] for axis in "xyz"] for row in (rows[0], rows[-1]))
    axis = [rows[-1][f"axis_{one}"] for one in "xyz"]
    for towards in (end, axis):
        assert [one / math.hypot(*towards) for one in towards] == pytest.approx(
            [one / math.hypot(*start) for one in start], abs=1e-9
        )


def test_abb_2_is_a_circle_about_a_centre_aside(run: Run, tmp_path: Path) -> None:
    rows = track(run, tmp_path, command_of("abb2"))
    centre = complex(1.0, -3.0) / (40.0 * rows[0]["omega_3_rad_s"])  # (M2 - i M1)/((A - C) ω3), Magnus 1970 (13)
    radii = [abs(complex(row["omega_1_rad_s"], row["omega_2_rad_s"]) - centre) for row in rows]
    assert max(radii) == pytest.approx(min(radii), rel=1e-6)
    assert abs(centre) > 0.1 * radii[0]


@pytest.mark.parametrize(
    ("topics", "allowed"),
    [([name for name in ("", *guide.NAMES) if name != guide.FILE], set()), ([guide.FILE], {"yaml"})],
    ids=["texts", "file"],
)
def test_the_guide_loads_no_numbers(tmp_path: Path, topics: list[str], allowed: set[str]) -> None:
    """Neither numpy nor scipy."""
    code = (
        f"import sys\nfrom nutdamp.cli.root import group\nfor topic in {topics!r}:\n"
        "    group.main(['explain', *topic.split()], standalone_mode=False)\n"
        "print('LOADED', *sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "PYTHONUTF8": "1"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    loaded = done.stdout.rpartition("LOADED ")[2].split()
    assert {"numpy", "scipy", "matplotlib", "yaml"} & set(loaded) <= allowed


def test_shells_complete_topics() -> None:
    found = ShellComplete(group, {}, "nutdamp", "_NUTDAMP_COMPLETE").get_completions(["explain"], "nu")
    assert [(item.value, item.type) for item in found] == [("nutation", "plain")]

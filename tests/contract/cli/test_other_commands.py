"""check, init, schema, simulate, help, version and completion; what each command loads."""

import json
import re
from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete
from support import places
from support.cases import spread, weekly
from support.commands import (
    EXACT,
    GOOD,
    call,
    python,
    refusals,
    result,
    rows,
    written,
)
from support.contract import BROKEN
from support.process import Run

from nutdamp import errors
from nutdamp.cli.main import COMMANDS, group
from nutdamp.files.tabular import HEADER
from nutdamp.planning import capability
from nutdamp.spacecraft.model import Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")


# --- check
# --------------------------------------------------------------------------------------------------


# --- init, schema, version
# --------------------------------------------------------------------------------------------


def test_init_writes_a_file_that_ships_as_it_is(run: Run, tmp_path: Path) -> None:
    run("init", "--from", "ace", "mine.yaml", status=0)
    assert (tmp_path / "mine.yaml").read_bytes() == (places.CONFIGS / "ace.yaml").read_bytes()


# --- check
# --------------------------------------------------------------------------------------------------


def test_check_goes_on_after_what_turns_out_late(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spin_axis = capability.spin_axis
    problem = "the motion changes too fast to be integrated"

    def late(spacecraft: Spacecraft) -> capability.SpinAxis:
        if spacecraft.name == "Late":
            raise errors.Infeasible(problem)
        return spin_axis(spacecraft)

    monkeypatch.setattr(capability, "spin_axis", late)
    written(tmp_path, good_yaml=GOOD, late_yaml=GOOD.replace("Good", "Late"))
    ended = call(run, "check late.yaml good.yaml --json check.json")
    assert (ended.returncode, ended.stderr) == (2, f"late.yaml:1:1: {problem}\n")
    assert "Good" in ended.stdout
    late_, good = json.loads((tmp_path / "check.json").read_text())["files"]
    assert (late_["valid"], good["valid"], late_["faults"][0]["problem"]) == (False, True, problem)


def test_of_very_many_faults_the_first_hundred_are_shown(run: Run, tmp_path: Path) -> None:
    thrusters = "".join(
        f"  - {{name: T{number}, paint: red, torque: [8, 0, 0]}}\n" for number in range(300)
    )
    written(tmp_path, f_yaml=f"{EXACT}thrusters:\n{thrusters}")
    shown = run("check", "f.yaml").stderr.splitlines()
    assert (len(shown), shown[-1]) == (101, "and 200 more faults")


@spread("name", BROKEN, quick=10)
def test_a_broken_file_stops_the_plan(run: Run, tmp_path: Path, name: str) -> None:
    text, expected = BROKEN[name]
    written(tmp_path, broken_yaml=text)
    said = refusals(
        run, tmp_path, ["plan broken.yaml --csv pulses.csv --json plan.json"]
    ).splitlines()[1:]
    assert len(said) == len(expected)
    for line, fault in zip(said, expected, strict=True):
        assert line.startswith(f"broken.yaml:{':'.join(fault.split(':')[:2])}: ")


def test_what_is_no_text_is_refused(run: Run, tmp_path: Path) -> None:
    for content in (
        bytes(range(256)),
        "name: Düse\n".encode("latin-1"),
        "name: X\n".encode("utf-16"),
        b"name: X\0\n",
    ):
        (tmp_path / "broken.yaml").write_bytes(content)
        assert (
            refusals(run, tmp_path, ["plan broken.yaml"])
            .splitlines()[1]
            .startswith("broken.yaml:1:")
        )


# --- help and completion
# ----------------------------------------------------------------------------------------------


def options_of(page: str) -> list[str]:
    """Options of a help page, by their long names."""
    return re.findall(r"^  (?:-\w, )?(--[\w-]+)", page, re.MULTILINE)


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help_pages_fit_a_terminal_and_have_few_options_and_help_all_every_one(
    run: Run, command: str
) -> None:
    page, other = (call(run, f"{command} {flag}", status=0).stdout for flag in ("-h", "--help"))
    assert page == other
    lines = page.splitlines()
    assert lines[0].startswith("Usage: ")
    assert len(lines) <= 60
    assert max(map(len, lines)) <= 80
    first = options_of(page)
    every = {*first}
    if "--help-all" in first:
        every = {*options_of(call(run, f"{command} --help-all", status=0).stdout)}
        assert {*first} < every
    assert len(first) == len({*first}) <= 20
    known = group.get_command(click.Context(group), command) or group
    options = {name for param in known.params for name in param.opts if name.startswith("--")}
    assert every - {"--help", "--help-all"} == options - {"--debug"}


COMPLETED = {
    **{
        f"{words} {name}": f"file {name}"
        for words, name in (
            ("plan", "sp"),
            ("check a.yaml", "sp"),
            ("init", "sp"),
            ("import apm", "sp"),
            ("simulate --schedule", "pul"),
            ("plan --csv", "out"),
            ("plan --json", "out"),
            ("plan --plot", "out"),
            ("report -o", "out"),
            ("schema --output", "out"),
        )
    },
    "trade --schedules out": "file out",
    "ver": "plain verify",
    "plan --targ": "plain --target",
    "plan --scheme two": "plain two-pulse",
    "plan --scheme rh": "plain rhumb-line",
    "explain momentum-sh": "plain momentum-shift, plain momentum-shift-of-target",
    "plan --set limits.h": "plain limits.horizon=",
    "plan --set thrusters.": "",  # each file names its own
}


def test_shells_complete_commands_options_choices_and_leave_files_to_the_shell() -> None:
    shell = ShellComplete(group, {}, "nutdamp", "_NUTDAMP_COMPLETE")
    for words, expected in COMPLETED.items():
        *before, last = words.split()
        offered = (f"{item.type} {item.value}" for item in shell.get_completions(before, last))
        assert ", ".join(offered) == expected, words


# --- what a command loads
# ---------------------------------------------------------------------------------------------

LOADED = """
import contextlib, sys
from nutdamp.cli.main import group
for words, heavy in {commands!r}:
    with contextlib.suppress(SystemExit):
        group.main(words.split(), standalone_mode=False)
    print("LOADED by", words, *sorted(set(heavy) & set(sys.modules)))
"""
HEAVY = ("scipy", "matplotlib", "pydantic", "jinja2")
LEAN = [
    [("--help", ("numpy", "yaml", "rich", *HEAVY))],
    [
        ("plan -q", ("numpy.ma", *HEAVY)),
        ("plan -q --scheme optimal --free-axis", ("numpy.ma", *HEAVY)),
        ("disperse -q --samples 100", HEAVY),
        ("simulate -q --scheme optimal", HEAVY),
    ],
    [
        (words, HEAVY)
        for words in (
            "plan -q --scheme optimal --least time",
            "plan -q --target 10deg,20deg",
            "plan -q --robust --scheme one-pulse",
            "trade -q --points 2",
            "disperse -q --samples 100 --scheme optimal",
        )
    ],
]


@pytest.mark.parametrize(
    "commands", [LEAN[0], pytest.param(LEAN[1], marks=pytest.mark.deep), weekly(LEAN[2])]
)
def test_a_command_loads_what_it_needs(
    tmp_path: Path, commands: list[tuple[str, tuple[str, ...]]]
) -> None:
    """A symmetric body needs no scipy, and none numpy.ma, a tenth of the start-up."""
    shown = python(tmp_path, LOADED.format(commands=commands)).stdout
    loaded = [line for line in shown.splitlines() if line.startswith("LOADED by")]
    assert loaded == [f"LOADED by {words}" for words, _ in commands]


@pytest.mark.deep
def test_products_of_small_matrices_have_one_thread(tmp_path: Path) -> None:
    """Unless the environment says otherwise."""
    code = (
        "import os, sys\n{}\nfrom nutdamp.cli.main import main\n"
        "sys.argv = ['nutdamp', '--version']\n"
        "try: main()\nfinally: print(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    for given, used in (
        ("os.environ.pop('OPENBLAS_NUM_THREADS', 0)", "1"),
        ("os.environ['OPENBLAS_NUM_THREADS'] = '3'", "3"),
    ):
        assert python(tmp_path, code.format(given)).stdout.splitlines()[-1] == used


# --- simulate: schemes, schedules and free motion, their track, and the exit status


def test_the_track_has_the_columns_of_the_contract(run: Run, tmp_path: Path) -> None:
    assert (
        run(
            "simulate", "--scheme", "four-pulse", "--csv", "track.csv", "--samples", "50"
        ).returncode
        == 4
    )
    track = rows((tmp_path / "track.csv").read_text())
    assert tuple(track[0]) == HEADER
    times = [float(row["t_s"]) for row in track]
    assert times == sorted(times)
    assert (track[0]["pulse"], track[-1]["pulse"]) == ("0", "4")
    for row in track:
        assert sum(float(row[f"q_{part}"]) ** 2 for part in "wxyz") == pytest.approx(1.0, abs=1e-14)
        cones = float(row["body_cone_deg"]) + float(row["space_cone_deg"])
        assert float(row["nutation_deg"]) == pytest.approx(cones, abs=1e-12)


def test_a_written_schedule_flies_as_it_was_planned(run: Run) -> None:
    """From a file, by its flown columns, or from standard input."""
    planned = result(run, "plan --scheme two-pulse --csv pulses.csv")["plans"][0]
    for flown in ("", "--flown"):
        flight = result(run, f"simulate --schedule pulses.csv {flown}")
        for kind in ("residual", "flown"):
            assert flight[kind] == pytest.approx(planned[kind], abs=1e-11)
    pulses = run("plan", "--scheme", "two-pulse", "--csv", "-", "-q").stdout
    assert result(run, "simulate --schedule -", stdin=pulses)["flown"] == flight["flown"]

"""check, init, schema, simulate, help, version and completion; what each command loads."""

import json
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete
from support import places
from support.broken import BROKEN
from support.cases import spread, weekly
from support.commands import EXACT, SCHEDULE, call, names, python, refusals, result, rows, written
from support.golden import check_text
from support.process import Run

from nutdamp import __version__, errors
from nutdamp.cli.main import COMMANDS, group
from nutdamp.cli.options import FileName
from nutdamp.files.tabular import HEADER
from nutdamp.planning import capability
from nutdamp.spacecraft.model import Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

GOOD = EXACT.replace("X", "Good")
TYPO = GOOD.replace("Good", "Typo").replace("C:", "c:")
TENSOR = """
name: Tilted
inertia: {tensor: [[120, 0, 2], [0, 118, 0], [2, 0, 80]]}
omega0: [0.1, 0, 3]
thrusters: [{name: T1, torque: [0, 8, 0], min_on_time: 20 ms}, {name: SPIN, torque: [0, 0, 5]}]
"""


# --- check
# --------------------------------------------------------------------------------------------------


def test_each_of_several_files_is_shown_as_alone_with_a_blank_line_below(
    run: Run, tmp_path: Path
) -> None:
    written(tmp_path, good_yaml=GOOD, plain_yaml=EXACT)
    alone = [run("check", name).stdout for name in ("good.yaml", "plain.yaml")]
    assert run("check", "good.yaml", "plain.yaml").stdout == "".join(f"{text}\n" for text in alone)


# --- init, schema, version
# --------------------------------------------------------------------------------------------


def test_init_writes_a_file_that_plans_and_takes_the_place_of_none_unless_forced(
    run: Run, tmp_path: Path
) -> None:
    assert run("init").returncode == 0
    assert run("plan", "--scheme", "two-pulse").returncode == 0
    assert "--force" in refusals(run, tmp_path, ["init"], 1)
    written(tmp_path, spacecraft_yaml="mine")
    assert run("init", "--force").returncode == run("init", "other.yaml").returncode == 0
    example = (tmp_path / "spacecraft.yaml").read_text()
    assert run("init", "-").stdout == (tmp_path / "other.yaml").read_text() == example
    assert run("plan", "other.yaml", "--scheme", "two-pulse").returncode == 0


def test_init_lists_and_writes_the_spacecraft_that_ship_with_nutdamp(
    run: Run, tmp_path: Path
) -> None:
    listed = run("init", "--list").stdout
    configs = [path.stem for path in places.CONFIGS.glob("*.yaml")]
    assert configs
    assert [name for name in configs if name not in listed] == names(tmp_path) == []
    assert run("init", "--from", "ace", "mine.yaml").returncode == 0
    assert (tmp_path / "mine.yaml").read_bytes() == (places.CONFIGS / "ace.yaml").read_bytes()
    assert "ACE" in run("check", "mine.yaml").stdout


def test_schema_is_json_and_the_version_is_that_of_the_package(run: Run, tmp_path: Path) -> None:
    schema = json.loads(run("schema").stdout)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert run("schema", "-o", "s.json").stdout == ""
    assert json.loads((tmp_path / "s.json").read_text()) == schema
    assert __version__ in run("--version").stdout


# --- check
# --------------------------------------------------------------------------------------------------


def test_check_prints_derived_quantities(run: Run) -> None:
    ended, full = run("check"), run("check", "-v")
    assert ended.returncode == full.returncode == 0
    check_text("cli.check.example", ended.stdout)
    check_text("cli.check.full", full.stdout)


def test_check_shows_all_faults_of_all_files(run: Run, tmp_path: Path) -> None:
    written(tmp_path, good_yaml=GOOD, typo_yaml=TYPO, tensor_yaml=TENSOR)
    # A bad file counts before one that cannot be read.
    ended = call(
        run, "check typo.yaml good.yaml missing.yaml tensor.yaml --json check.json", status=2
    )
    check_text("cli.check.files", ended.stderr + ended.stdout)
    files = json.loads((tmp_path / "check.json").read_text())["files"]
    assert [entry["valid"] for entry in files] == [False, True, False, True]
    assert files[0]["faults"][0]["line"] == 2
    assert files[3]["channels"][1]["damps"] is False
    axes = files[3]["spacecraft"]["principal_axes"]
    assert axes[0][2] == pytest.approx(-axes[2][0], abs=1e-12)  # the tilt about axis 2


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


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_bad_file_counts_before_a_report_that_cannot_be_written(run: Run, tmp_path: Path) -> None:
    written(tmp_path, good_yaml=GOOD, typo_yaml=TYPO)
    assert call(run, "check good.yaml typo.yaml --json /dev/full").returncode == 2
    assert call(run, "check good.yaml --json /dev/full").returncode == 1


def test_warnings_are_shown_by_every_command_and_in_json(run: Run, tmp_path: Path) -> None:
    """Also by those that are told to be quiet."""
    written(tmp_path, fast_yaml=GOOD.replace("3]", "300]"))
    ended = call(run, "check fast.yaml --json check.json", status=0)
    check_text("cli.check.warning", ended.stderr)
    (entry,) = json.loads((tmp_path / "check.json").read_text())["files"]
    (warning,) = entry["warnings"]
    assert entry["valid"]
    assert warning.pop("place").endswith(".yaml:3:18")
    place = {"line": 3, "column": 18, "where": "omega0[2]"}
    assert warning == place | {"problem": ended.stderr.partition("warning: ")[2].rstrip("\n")}
    for command in ("check -q", "plan --scheme one-pulse -q", "simulate --scheme none -q"):
        assert call(run, f"{command} fast.yaml").stderr.startswith(ended.stderr)
    allowed = [
        call(run, f"trade --points 1 --set limits.horizon=10ms --allow {angle}")
        for angle in ("0.1", "0.1deg", "0")
    ]
    check_text("cli.check.allow", "\n".join(trade.stderr for trade in allowed))


def test_a_misspelt_inertia_stops_every_command(run: Run, tmp_path: Path) -> None:
    written(tmp_path, typo_yaml=TYPO)
    commands = [
        f"{command} typo.yaml"
        for command in ("plan", "simulate --scheme none", "check", "verify", "report")
    ]
    check_text("cli.check.misspelt", refusals(run, tmp_path, commands))


def test_what_is_set_is_planned_and_checked_in_all_files(run: Run, tmp_path: Path) -> None:
    planned = result(
        run,
        (
            "plan -q --nominal --scheme four-pulse "
            "--set 'state.nutation=8 deg' --set limits.horizon=300s"
        ),
    )
    assert planned["spacecraft"]["nutation_deg"] == pytest.approx(8.0)
    for name in ("a.yaml", "b.yaml"):
        run("init", name)
    assert call(run, "check a.yaml b.yaml --set 'state.spin=31 rpm'").stdout.count("31 rpm") == 2
    (fault,) = result(run, "check a.yaml --set mass=0", status=2)["files"][0]["faults"]
    assert (fault["line"], fault["column"], fault["where"]) == (None, None, "mass")
    assert fault["place"].startswith("--set mass=")


DISPERSED = """\
name: Sat
inertia: {A: 120, C: 80}
omega0: [0.1, 0.2, 3]
thrusters:
  - {name: left 1, position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 10 N}
  - {name: T2, torque: [0, 8, 0]}
  - {name: T3, torque: [0, -8, 0]}
channels: {+: [left 1], -: [T2]}
dispersions:
  A: {normal: 0}
  thrust: {normal: 3 %}
  thrust_direction: {normal: 0.5 deg}
  timing: {uniform: 5 ms}
"""


def test_check_says_what_could_be_drawn_and_what_touches_nothing_that_can_fire(
    run: Run, tmp_path: Path
) -> None:
    written(tmp_path, sat_yaml=DISPERSED, exact_yaml=DISPERSED.partition("dispersions:")[0])
    check_text("cli.check.dispersions", run("check", "sat.yaml", "-v").stdout)
    inputs = [
        "thrust left 1",
        "thrust T2",
        "direction left 1 a",
        "direction left 1 b",
        "timing of each pulse",
    ]
    dispersions = result(run, "check sat.yaml")["files"][0]["dispersions"]
    assert [entry["name"] for entry in dispersions["inputs"]] == inputs
    assert set(dispersions["unused"]) == {"A", "thrust T3", "direction T2", "direction T3"}
    assert "dispersion" not in run("check", "exact.yaml").stdout
    assert result(run, "check exact.yaml")["files"][0]["dispersions"] is None


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


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_every_help_page_fits_the_screen_of_a_terminal(run: Run, command: str) -> None:
    pages = [call(run, f"{command} {flag}") for flag in ("-h", "--help")]
    assert pages[0].stdout == pages[1].stdout
    assert pages[0].returncode == 0
    lines = pages[0].stdout.splitlines()
    assert lines[0].startswith("Usage: ")
    assert len(lines) <= 60
    assert max(map(len, lines)) <= 80


def test_trade_shows_no_option_that_it_does_not_read(run: Run) -> None:
    """No scheme of a front reads the Sun, and none is left out of it for a bug."""
    shown = run("trade", "--help").stdout
    assert [option in shown for option in ("--target", "--sun", "--debug")] == [True, False, False]


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
}


def test_shells_complete_commands_options_choices_and_leave_files_to_the_shell() -> None:
    shell = ShellComplete(group, {}, "nutdamp", "_NUTDAMP_COMPLETE")
    for words, expected in COMPLETED.items():
        *before, last = words.split()
        assert [f"{item.type} {item.value}" for item in shell.get_completions(before, last)] == [
            expected
        ], words


@pytest.mark.deep
def test_completion_is_that_of_a_process_called_nutdamp() -> None:
    code = "import sys; sys.argv = ['nutdamp']; from nutdamp.cli.main import main; main()"
    asked = {
        "_NUTDAMP_COMPLETE": "bash_complete",
        "COMP_WORDS": "nutdamp plan sp",
        "COMP_CWORD": "2",
    }
    process = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **asked},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (process.stdout, process.stderr) == ("file,sp\n", "")


def test_every_file_of_every_command_is_completed() -> None:
    files = ("spacecraft", "files", "file", "csv", "json", "plot", "output", "schedule")
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        for parameter in command.params:
            assert parameter.name not in files or isinstance(parameter.type, FileName), (
                f"{name}: {parameter.name}"
            )


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

ATTITUDE = "attitude={epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}"


def test_the_screen_of_a_scheme(run: Run) -> None:
    """With right ascension and declination where the file has an attitude."""
    plain, full = (run("simulate", "--scheme", "two-pulse", *more) for more in ((), ("-v",)))
    dated = run("simulate", "--scheme", "two-pulse", "-v", "--set", ATTITUDE)
    assert plain.returncode == full.returncode == dated.returncode == 0
    check_text("cli.simulate.screen", plain.stdout)
    check_text("cli.simulate.full", full.stdout)
    assert "right ascension" in dated.stdout
    assert "EME2000" in dated.stdout


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


@pytest.mark.parametrize(
    ("keys", "scheme", "status", "grows"),
    [
        ("upper-stage.yaml --set limits.tick=20ms", "one-pulse", 0, True),
        ("communications-spinner.yaml --set limits.max_pulses=3", "four-pulse", 4, False),
    ],
)
def test_a_written_schedule_is_judged_as_the_plan_wherever_the_simulation_ends(
    run: Run, keys: str, scheme: str, status: int, grows: bool
) -> None:
    """The motion after the last pulse changes; what is said of its end is marked as that."""
    file = f"{places.CONFIGS}/{keys}"
    planned = result(run, f"plan {file} --nominal --scheme {scheme} --csv own.csv", status=status)
    for until in ("", "--until 300s"):
        flight = result(run, f"simulate {file} --schedule own.csv {until}", status=status)
        assert flight["judged_s"] == pytest.approx(planned["plans"][0]["end_s"], abs=1e-9)
        ways = zip(
            planned["decision"]["requirement"], flight["decision"]["requirement"], strict=True
        )
        for before, after in ways:
            assert after["nominal_deg"] == pytest.approx(before["nominal_deg"], abs=1e-9)
            assert after["part"] == before["part"]
    screen = run("simulate", *file.split(), "--schedule", "own.csv", "--until", "300s").stdout
    assert ("note[judged-at-end]" in screen) is grows


def test_schedules_by_hand_may_be_short_and_settings_are_doubted(run: Run, tmp_path: Path) -> None:
    written(
        tmp_path,
        own_csv=SCHEDULE.replace(",channel", "").replace("1,0,steerable,4", "1,0,-5")
        + "2,0.5,0,4,0\n",
    )
    first, second = result(run, "simulate --schedule own.csv", status=4)["pulses"]
    assert first["torque_Nm"] is None
    assert second["torque_Nm"] == pytest.approx([0, 8, 0])
    run("plan", "--scheme", "one-pulse", "--csv", "pulses.csv")
    edited = run(
        "simulate", "--schedule", "pulses.csv", "--set", "state.nutation=0.2", "--quiet", status=4
    )
    check_text("cli.simulate.doubts", edited.stderr)  # which --quiet leaves


def test_without_a_scheme_the_recommended_plan_is_propagated_and_named(run: Run) -> None:
    ended = run("simulate", status=0)
    assert "using recommended plan: two-pulse\n" in ended.stderr
    assert ended.stdout == run("simulate", "--scheme", "two-pulse").stdout


def test_free_motion_keeps_its_nutation_and_the_end_can_be_chosen(run: Run) -> None:
    free = result(run, "simulate --scheme none", status=4)
    assert free["pulses"] == []
    assert free["flown"]["nutation_deg"] == pytest.approx(
        free["spacecraft"]["nutation_deg"], rel=1e-12
    )
    early = result(run, "simulate --scheme two-pulse --until '3 s'")
    assert early["until_s"] == 3.0
    assert early["flown"]["nutation_deg"] > 1.0  # the second pulse is still to come


def test_the_exit_status_is_that_of_plan(run: Run, tmp_path: Path) -> None:
    """3 where the scheme is infeasible, 4 where its plan is not shown to comply; so for none."""
    written(tmp_path, ideal_yaml=EXACT)
    infeasible = run("simulate", "ideal.yaml", "--scheme", "four-pulse")
    assert (infeasible.returncode, "infeasible" in infeasible.stderr) == (3, True)
    tight = ("--set", "requirement.momentum_shift=1e-4 deg")
    for scheme, settings, status in (
        ("one-pulse", (), 4),
        ("two-pulse", (), 0),
        ("two-pulse", tight, 4),
    ):
        assert run("plan", "--scheme", scheme, *settings).returncode == status
        ended = run("simulate", "--scheme", scheme, *settings)
        assert (ended.returncode, "\nNOT ENOUGH: " in ended.stdout) == (status, status == 4)
    assert run("simulate", "--scheme", "none", *tight).returncode == 4
    early = run("simulate", "--scheme", "two-pulse", "--until", "1 ms")
    assert (early.returncode, "0 to 0.001 s" in early.stdout) == (0, True)


KEEPER = """
name: Keeper
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
steerable: {torque: 60 N m}
requirement: {nutation: 1 deg}
attitude: {frame: EME2000, quaternion: [1, 0, 0, 0]}
keep: [{name: star, direction: [0, 89 deg], min: 5 deg}]
"""


def test_a_broken_cone_is_exit_4_and_said_once(run: Run, tmp_path: Path) -> None:
    """By the verdict on the screen; as a remark where the results take the place of the screen."""
    command = ("simulate", "-", "--scheme", "two-pulse")
    assert run(*command, "--set", "keep=[]", stdin=KEEPER).returncode == 0
    assert run(*command, "--json", "end.json", stdin=KEEPER).returncode == 4
    assert json.loads((tmp_path / "end.json").read_text())["decision"]["met"] is False
    for named in (command, command[:2]):
        for outputs in ((), ("--json", "-")):
            ended = run(*named, *outputs, stdin=KEEPER)
            said = " ".join((ended.stderr + ended.stdout * (not outputs)).split())
            assert said.lower().count("the spin axis comes to") == 1


def test_with_a_target_the_screen_says_how_far_off_it_ends(run: Run) -> None:
    done = run("simulate", "--scheme", "none", "--target", "10deg,45deg", "--samples", "2")
    assert "axis error" in done.stdout

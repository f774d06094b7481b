"""Output where a stream, a disk or a signal is in its way; refusals before the work."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support import places
from support.cases import deep, spread, weekly
from support.commands import (
    BUILT_IN,
    DATED,
    EXACT,
    SCHEDULE,
    call,
    contents,
    names,
    python,
    refusals,
    written,
)
from support.golden import check_text
from support.process import Run

from nutdamp.cli.main import visible
from nutdamp.files.reader import example_text

pytestmark = pytest.mark.usefixtures("plans_shared")

FULL = Path("/dev/full")
POSIX = pytest.mark.skipif(
    os.name != "posix", reason="needs limits, signals and descriptors of POSIX"
)
NEEDS_FULL = pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")
LINUX = pytest.mark.skipif(
    sys.platform != "linux", reason="names of files are bytes on Linux alone"
)


def shell(
    folder: Path, line: str, *arguments: str, **more: str
) -> subprocess.CompletedProcess[str]:
    """``$0 -m nutdamp`` in a shell, with more in its environment."""
    environment = {**os.environ, "COLUMNS": "80", "NO_COLOR": "1", **more}
    return subprocess.run(
        ["sh", "-c", line, sys.executable, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        encoding="latin-1",
        check=False,
    )


# --- streams
# --------------------------------------------------------------------------------------------------


@NEEDS_FULL
@spread(
    "command", ["check -q", "plan -q", "plan -q --json -", "--help", "explain"], quick=1, deep=2
)
def test_a_full_standard_output_is_said_in_one_line(tmp_path: Path, command: str) -> None:
    ended = shell(tmp_path, f'exec "$0" -m nutdamp {command} >{FULL}')
    assert ended.returncode == 1
    assert re.fullmatch(r".*cannot write.*No space left.*\n", ended.stderr.removeprefix(BUILT_IN))


@pytest.mark.deep
@POSIX
def test_a_process_without_standard_output_reader_or_greek_letters_does_its_work(
    tmp_path: Path,
) -> None:
    for command in ("plan --quiet", "plan --quiet --csv -"):
        closed = shell(tmp_path, f'exec "$0" -m nutdamp {command} --json pulses.json >&-')
        assert (closed.returncode, closed.stderr, names(tmp_path)) == (0, BUILT_IN, ["pulses.json"])
    track = '"$0" -m nutdamp simulate --scheme none --samples 50000 --csv - | head -n 1'
    left = shell(tmp_path, track)
    assert left.stdout.startswith("t_s,")
    assert "Traceback" not in left.stderr
    latin = {"PYTHONIOENCODING": "latin-1", "PYTHONUTF8": "0"}
    ended = shell(tmp_path, 'exec "$0" -m nutdamp check --quiet', **latin)
    assert (ended.returncode, ended.stderr) == (0, BUILT_IN)
    assert "A|?0|" in ended.stdout


# --- disks and signals
# ------------------------------------------------------------------------------------------------


@POSIX
@pytest.mark.parametrize(
    ("command", "shown"),
    [
        deep("simulate --scheme two-pulse --csv big.csv --json small.json", "momentum shift"),
        deep(
            "disperse --scheme two-pulse --samples 2000 --csv big.csv --json small.json",
            "nutation, deg",
        ),
        weekly("plan --plot big.svg --json small.json", "fly two-pulse"),
        weekly("trade --points 1 --plot big.png --json small.json", "cheapest: "),
    ],
)
def test_the_result_is_shown_where_a_file_cannot_be_saved(
    tmp_path: Path, command: str, shown: str
) -> None:
    """A run that may write no file beyond 32 KiB, as on a disk that is nearly full."""
    ended = shell(tmp_path, 'ulimit -f 64; exec "$0" -m nutdamp "$@"', *command.split(), "-q")
    assert ended.returncode == 1, ended.stderr
    assert shown in ended.stdout.lower()
    assert re.fullmatch("nutdamp: cannot write big.*\n", ended.stderr.removeprefix(BUILT_IN))
    assert names(tmp_path) == ["small.json"]


@NEEDS_FULL
@pytest.mark.parametrize(
    "command",
    [
        "plan --csv /dev/full --json /dev/full",
        "disperse --case 1 --scheme two-pulse --json /dev/full",
        deep("disperse --samples 100 --json /dev/full"),
        deep("verify --json /dev/full"),
        deep("trade --points 1 --schedules file"),
    ],
)
def test_each_file_that_cannot_be_saved_is_named_below_the_result(
    run: Run, tmp_path: Path, command: str
) -> None:
    written(tmp_path, file="")
    ended = call(run, f"{command} -q", status=1)
    assert "Sounder-1" in ended.stdout
    full = "nutdamp: cannot write /dev/full: No space left on device\n"
    folder = "nutdamp: cannot write file: it is there, and no directory\n"
    failures = folder if command.startswith("trade") else full * command.count(str(FULL))
    assert ended.stderr == BUILT_IN + failures


TERMINATED = """
import os, signal, sys
from importlib import import_module
from nutdamp.cli.main import main

module = import_module("nutdamp.{module}")
made = module.{function}

def slow(*given, **named):
    os.kill(os.getpid(), signal.SIGTERM)
    return made(*given, **named)

module.{function} = slow
sys.argv = ["nutdamp", *{arguments!r}.split()]
main()
"""
WRITING = """
import os, signal, sys
import click
from nutdamp.cli.main import run
from nutdamp.files.tabular import whole_file

@click.group()
def group(): ...

@group.command()
def write():
    with whole_file("x.csv") as stream:
        stream.write(b"half")
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)  # the second one does not disturb

sys.argv = ["nutdamp", "write"]
run(group)
"""


@POSIX
@spread(
    ("arguments", "module", "function"),
    [
        ("check --json x.json", "views.check", "check_json"),
        ("plan spacecraft.yaml --json x.json", "files.reader", "read_spacecraft"),
        ("plan --json x.json --csv x.csv", "files.tabular", "json_text"),
        ("simulate --scheme two-pulse --csv x.csv --json x.json", "files.tabular", "json_text"),
        ("verify --json x.json", "views.simulation", "verification_json"),
        ("report -o x.html", "files.reader", "read_spacecraft"),
        ("export --format json -o x.json", "files.tabular", "json_text"),
    ],
    quick=1,
    deep=4,
)
def test_sigterm_ends_a_command_in_order(
    tmp_path: Path, arguments: str, module: str, function: str
) -> None:
    written(tmp_path, spacecraft_yaml=EXACT)
    code = TERMINATED.format(arguments=arguments, module=module, function=function)
    ended = python(tmp_path, code, status=128 + signal.SIGTERM)
    assert ended.stderr.splitlines()[-1] == "terminated"
    assert "Traceback" not in ended.stderr
    assert names(tmp_path) == ["spacecraft.yaml"]


@POSIX
def test_sigterm_while_a_file_is_written_leaves_what_was_there(tmp_path: Path) -> None:
    written(tmp_path, x_csv="before")
    assert python(tmp_path, WRITING, status=143).stderr == "terminated\n"
    assert contents(tmp_path) == {"x.csv": b"before"}


# --- names that look like markup, control the terminal, or are not UTF-8
# ----------------------------------------------


HOSTILE = "\x1b]0;PWNED\x07\x1b[2J\x9b31m"
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029]")
BODY = EXACT + "attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}\n"


def test_no_control_character_of_a_name_a_unit_or_an_option_reaches_the_terminal(
    run: Run, tmp_path: Path
) -> None:
    """Whatever file it stands in."""
    (tmp_path / f"there-{HOSTILE}\n.csv").write_text(SCHEDULE)
    (tmp_path / f"there-{HOSTILE}\n.yaml").write_text(
        BODY.replace("inertia", "inetria") + '"\x1b[2J": 1\n'
    )
    (tmp_path / f"good-{HOSTILE}\n.yaml").write_text(BODY)
    head = "CCSDS_APM_VERS = 2.0\nCREATION_DATE = 2026-03-01T12:00:00\nORIGINATOR = X\n"
    written(
        tmp_path,
        body_yaml=BODY,
        message_txt=f"{head}INERTIA_START\nIXX = 120 [{HOSTILE}]\nINERTIA_STOP\n",
    )
    two = ("plan", "body.yaml", "--scheme", "two-pulse")
    said = ""
    for status, *command in (
        (1, "plan", f"{HOSTILE}\n.yaml"),
        (2, HOSTILE),
        (2, "plan", "--scheme", HOSTILE),
        (2, "plan", "--on-time", HOSTILE),
        (1, "check", f"{HOSTILE}.yaml", "--json", "-"),
        (1, *two, "--csv", f"no/{HOSTILE}/folder.csv"),
        (2, *two, "--plot", f"{HOSTILE}.{HOSTILE}"),
        (1, "simulate", "body.yaml", "--schedule", f"{HOSTILE}.csv"),
        (0, "simulate", "body.yaml", "--schedule", f"there-{HOSTILE}\n.csv"),
        (2, "check", f"there-{HOSTILE}\n.yaml"),
        (2, "import", "apm", "message.txt"),
        (2, "import", "apm", f"there-{HOSTILE}\n.csv"),
        *(
            (2, *command, "body.yaml", "--schedule", str(places.case("crash-ansi-channel.csv")))
            for command in (("simulate",), ("verify",), ("export", "--format", "json"))
        ),
    ):
        ended = run(*command, status=status)
        assert not CONTROL.search(ended.stdout + ended.stderr)
        said += (
            ended.stderr.rpartition("\nError: ")[2]
            .replace(str(places.CASES), "CASES")
            .replace(str(tmp_path), "")
        )
    check_text("cli.streams.hostile", said)
    assert (
        visible("a\x1b[2J\r\u202e\u2028\nωθ° ×…\udcff")
        == r"a\x1b[2J\r\u202e\u2028" + "\nωθ° ×…" + r"\udcff"
    )
    assert not CONTROL.search(run("plan", f"--{HOSTILE}").stderr)
    shown = run("check", f"good-{HOSTILE}\n.yaml", "--json", "-").stdout
    assert not CONTROL.search(shown)
    assert json.loads(shown)["files"][0]["file"] == f"good-{HOSTILE}\n.yaml"


ODD = os.fsdecode(b"d\xfcse")
"""A name in Latin-1."""


@pytest.fixture
def odd(run: Run, tmp_path: Path) -> None:
    """A spacecraft with an attitude; beside it a schedule, odd as well."""
    (tmp_path / f"{ODD}.yaml").write_text(example_text() + BODY[BODY.index("attitude") :])
    assert (
        run(
            "plan", f"{ODD}.yaml", "--scheme", "two-pulse", "--csv", f"{ODD}.csv", "--quiet"
        ).returncode
        == 0
    )


@LINUX
@pytest.mark.weekly
@pytest.mark.usefixtures("odd")
@pytest.mark.parametrize(
    "command",
    [
        "plan {0}.yaml --json out.json --plot out.png",
        "check {0}.yaml --json out.json",
        "simulate {0}.yaml --schedule {0}.csv --json out.json --plot out.svg",
        "verify {0}.yaml --schedule {0}.csv --json out.json",
        (
            "disperse {0}.yaml --schedule {0}.csv --samples 50 "
            "--json out.json --plot out.png --csv {0}.out"
        ),
        "trade {0}.yaml --points 1 --json out.json --schedules {0}",
        "report {0}.yaml -o {0}.html",
        "animate {0}.yaml --schedule {0}.csv -o {0}.gif --seconds 0.2 --fps 5 --width 320",
        "export {0}.yaml --schedule {0}.csv --format apm -o {0}.xml",
        *(
            f"export {{0}}.yaml --schedule {{0}}.csv --format {form} -o {{0}}.{ending}"
            for form, ending in (
                ("apm", "apm"),
                ("aem", "aem"),
                ("stk", "a"),
                ("basilisk", "py"),
                ("json", "json"),
            )
        ),
    ],
)
def test_every_command_takes_names_that_are_not_utf_8(
    run: Run, tmp_path: Path, command: str
) -> None:
    assert "Traceback" not in run(*command.format(ODD).split(), status=(0, 4)).stderr
    for path in tmp_path.iterdir():
        if path.suffix == ".json":
            json.loads(path.read_text(encoding="utf-8"))
        elif path.suffix in (".html", ".apm", ".xml", ".aem", ".py"):
            path.read_text(encoding="utf-8")


@LINUX
@pytest.mark.usefixtures("odd")
def test_where_such_names_are_shown_or_written_they_are_escaped_and_json_gives_them_back(
    run: Run, tmp_path: Path
) -> None:
    """A message of such a name becomes a spacecraft file."""
    assert (
        run(
            "export", f"{ODD}.yaml", "--format", "apm", "--scheme", "none", "-o", f"{ODD}.apm"
        ).returncode
        == 4
    )
    message = run("import", "apm", f"{ODD}.apm")
    assert message.stdout.startswith(
        r"# From the attitude message d\udcfcse.apm; numbers as given there."
    )
    written(tmp_path, again_yaml=message.stdout)
    assert run("check", "again.yaml").returncode == 0
    ended = run("check", f"{ODD}.yaml", "missing" + ODD, "--json", "-")
    assert [entry["file"] for entry in json.loads(ended.stdout)["files"]] == [
        f"{ODD}.yaml",
        "missing" + ODD,
    ]
    assert ended.stderr == "nutdamp: cannot read missingd\\udcfcse: no such file or directory\n"


def test_an_interrupt_while_modules_are_imported_ends_quietly(
    run_apart: Run, tmp_path: Path
) -> None:
    (tmp_path / "click.py").write_text("raise KeyboardInterrupt")  # `python -m` looks here first
    ended = run_apart("--version")
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "interrupted\n")


# --- refused, or what cannot be read or written is named: before the work, and nothing written

TARGET = "--target 10deg,45deg"
USAGE = {
    "commands": [
        "fly",
        "simulatte",
        "plan --no-such-option",
        "import aem there.aem",
        "disperse --resume x.npz",
        "disperse --flown",
        "disperse --impulses",
    ],
    "schemes": [
        "plan --scheme five-pulse",
        "plan --scheme two-puls",
        "report --scheme three-pulse",
    ],
    "numbers": [
        "plan --on-time '20 Hz'",
        "plan --on-time 0",
        "simulate --scheme one-pulse --until -1",
        "simulate --scheme one-pulse --until '1 m'",
        "simulate --scheme one-pulse --samples 1",
        "disperse --samples 0",
        "disperse --samples -5",
        "disperse --samples 1.5",
        "disperse --samples many",
        "disperse --case 0",
        "disperse --threads 0",
        "disperse --seed -1",
        "report --disperse 0",
        "report --disperse nan",
        "report --disperse 1.5",
        "report --trade 0",
        "animate -o a.gif --until '-1 s'",
        "animate -o a.gif --seconds 0",
        "animate -o a.gif --fps 0",
        "animate -o a.gif --width 10",
        "export dated.yaml --format aem --until '0 s'",
        "export --format spin-table --scheme none --until '1e9 s'",
    ],
    "angles": [
        "plan --spin 0rpm",
        "plan --target 10,45",
        "plan --scheme rhumb-line --target 40deg,0deg --sun 190deg,0deg",
        "report --target 10deg",
        "plan --target 10,5deg,45deg",
        "plan --spin 0,5rpm",
    ],
    "settings": ["plan --set mass"],
    "endings": [
        "plan --plot a.jpg",
        "plan --plot a",
        "simulate --scheme one-pulse --plot picture.bmp",
        "disperse --samples 10 --plot x.jpg",
        "animate -o a.webm",
        "report -o report.pdf",
        "report -o report.md",
        "report -o report",
    ],
    "figures": ["plan --plot a.png --figure globe", "disperse --figure cases"],
    "dropped figures": [
        "plan --plot a.png --figure history",
        "disperse --plot a.png --figure budget",
    ],
    "left out": [
        "animate",
        "import",
        "export dated.yaml",
        "export --format apm body.yaml other.yaml",
    ],
    "contradictions": [
        "plan --scheme one-pulse --scheme two-pulse --csv x.csv",
        "plan --scheme one-pulse --scheme two-pulse --plot a.png",
        "simulate --scheme one-pulse --schedule x.csv",
        "disperse --scheme two-pulse --schedule x.csv",
        "animate -o a.gif --scheme none --schedule a.csv",
        "export dated.yaml --format apm --scheme two-pulse --schedule p.csv",
        "plan --robust --nominal",
        "report --nominal --disperse 100",
        "report --disperse --nominal",
        "report --schedule p.csv --blocks b.csv",
        "report --scheme optimal --schedule p.csv",
        "report --schedule p.csv --robust",
        "report --robust --nominal",
        "disperse --case 3 --csv x.csv",
        "export dated.yaml --format stk --xml",
        "export --format spin-table --scheme none --xml",
        "export dated.yaml --format apm --until '3 s'",
    ],
    "standard output": [
        "plan --csv - --json -",
        "plan --plot - --csv -",
        "disperse --csv - --json -",
        "import apm there.apm -o - --schedule -",
    ],
    "options of plan": [
        "simulate --scheme four-pulse --coarse",
        "verify --on-time 200ms",
        "disperse --literal",
        "animate -o x.gif --cones 3",
        "export --format json --free-axis",
        "report --per-turn 2",
        "trade --shift 1deg",
    ],
    "sun": [
        f"{command} --sun 70deg,0deg"
        for command in (
            f"plan --scheme half-cone {TARGET}",
            "plan",
            f"simulate --scheme two-pulse {TARGET}",
            f"trade {TARGET}",
            "simulate dated.yaml --schedule pulses.csv",
            f"report --scheme optimal {TARGET}",
        )
    ],
    "targets": [
        *(
            f"{command} --scheme {scheme}"
            for scheme in ("half-cone", "rhumb-line")
            for command in ("plan", "simulate", "verify", "export --format json", "report")
        ),
        "plan --scheme half-cone --scheme rhumb-line",
    ],
    "topics": [
        f"explain {topic}"
        for topic in (
            "tow-pulse",
            "nutaton",
            "unitz",
            "28",
            "K4",
            "file.thruster",
            "file.horizon",
            "file.qqq.zzz",
            "weather",
        )
    ],
    "examples": ["init --from lunar-prospecter", "init --from zzz"],
    "empty": ["plan -", "simulate --schedule - -q", "import apm -"],
}
UNREACHABLE = {  # before the work, which would take hours for some
    "unreachable": [
        f"{command} --quiet"
        for command in (
            "plan missing.yaml",
            "check missing.yaml",
            "report missing.yaml",
            "export missing.yaml --format apm",
            "simulate --schedule missing.csv",
            "import apm missing.apm",
            "plan --json folder",
            "plan --plot no/x.png",
            "plan --csv no/such/x.csv",
            "plan --csv no/x.csv",
            "simulate --scheme none --json no/x.json",
            "trade --points 1000 --csv no/x.csv",
            "disperse --samples 1e10 --json no/x.json",
            "animate -o no/x.gif --seconds 600",
            "report -o no/x.html",
            "export --format json -o no/x.json",
            "export dated.yaml --format apm --scheme two-pulse -o no/x.apm",
            "verify --json no/x.json",
            "import apm empty.apm -o no/x.yaml",
        )
    ],
    "devices": [
        "check /dev/zero",
        "plan /dev/full",
        "simulate -q --schedule /dev/zero",
        "import /dev/null",
        "fit -q /dev/zero",
    ],
}


@pytest.mark.parametrize("kind", [*USAGE, *UNREACHABLE])
def test_a_bad_command_line_is_exit_2_and_what_cannot_be_read_or_written_exit_1(
    run: Run, tmp_path: Path, kind: str
) -> None:
    if kind == "devices" and not (FULL.exists() and Path("/dev/zero").exists()):
        pytest.skip("no such device")
    (tmp_path / "folder").mkdir()
    written(tmp_path, dated_yaml=DATED, pulses_csv=SCHEDULE)
    if kind == "unreachable":
        message = run("export", "dated.yaml", "--format", "apm", "--scheme", "none").stdout
        written(tmp_path, empty_apm=message)
    commands = USAGE.get(kind) or UNREACHABLE[kind]
    said = refusals(run, tmp_path, commands, 2 if kind in USAGE else 1, stdin="")
    check_text(f"cli.refused.{kind}", said)


TWICE = [
    *(f"plan in.yaml {option} in.yaml" for option in ("--csv", "--json", "--plot")),
    *(
        f"plan in.yaml --csv {way}"
        for way in ("./in.yaml", "deep/../in.yaml", "FOLDER/in.yaml", "symbolic.yaml", "hard.yaml")
    ),
    "plan symbolic.yaml --csv in.yaml",
    *(
        f"plan in.yaml --csv new.csv --json {way}"
        for way in ("new.csv", "deep/../new.csv", "dangling")
    ),
    "simulate in.yaml --schedule s.csv --csv s.csv",
    "simulate in.yaml --schedule s.csv --json in.yaml",
    "disperse in.yaml --schedule s.csv --json s.csv",
    "verify in.yaml --schedule s.csv --json s.csv",
    "check a.yaml in.yaml --json in.yaml",
    "trade in.yaml --csv new.csv --json new.csv",
    "trade point-1.csv --schedules .",
    "trade in.yaml --csv deep/point-3.csv --schedules deep",
    "export in.yaml --format json -o in.yaml",
    "export in.yaml --format json --schedule s.csv -o s.csv",
    "report in.html -o in.html",
    "animate in.yaml -o film.gif --schedule film.gif",
    "import apm in.yaml -o in.yaml",
    "import apm in.yaml -o new.csv --schedule new.csv",
    "plan --csv spacecraft.yaml",
]


def test_one_file_for_two_purposes_is_exit_2(run: Run, tmp_path: Path) -> None:
    """By whatever way the file is named; nor may an output be the file that is read unnamed."""
    for name in ("in.yaml", "point-1.csv", "s.csv", "spacecraft.yaml"):
        (tmp_path / name).write_text(EXACT + "dispersions: {A: {normal: 1 %}}\n")
    (tmp_path / "deep").mkdir()
    (tmp_path / "symbolic.yaml").symlink_to("in.yaml")
    (tmp_path / "dangling").symlink_to("new.csv")
    for name in ("hard.yaml", "in.html", "film.gif"):
        (tmp_path / name).hardlink_to(tmp_path / "in.yaml")
    check_text("cli.refused.twice", refusals(run, tmp_path, TWICE))


def test_what_is_no_file_may_be_named_twice_and_an_output_as_what_is_read_unnamed(run: Run) -> None:
    both = f"--csv {os.devnull} --json {os.devnull}"
    ended = call(run, f"plan --scheme one-pulse --quiet {both}", status=4)
    assert ended.stderr == BUILT_IN
    call(run, "plan --scheme two-pulse --quiet --csv spacecraft.yaml", status=0)


@POSIX
def test_standard_output_is_a_purpose_too(tmp_path: Path) -> None:
    for options in ("--csv out", "--csv - --json out"):
        ended = shell(tmp_path, f'exec "$0" -m nutdamp plan {options} >out')
        assert ended.returncode == 2
        assert "goes to this file" in ended.stderr


@pytest.mark.skipif(os.name != "posix", reason="links and devices")
def test_a_path_that_cannot_be_is_exit_1(run: Run, tmp_path: Path) -> None:
    (tmp_path / "loop-a").symlink_to("loop-b")
    (tmp_path / "loop-b").symlink_to("loop-a")
    circle, long = ("symlink loop", "too many levels of symbolic links"), ("file name too long",)
    paths = {
        "loop-a": circle,
        "loop-a/x.csv": circle,
        "x" * 300: long,
        "/".join(["y" * 200] * 25): long,
    }
    for command in ("plan --scheme one-pulse --csv", "simulate --scheme none --json", "init"):
        for path, reasons in paths.items():
            ended = run(*command.split(), path, status=1)
            assert ended.stderr.lower().rstrip("\n").endswith(reasons), command


HEADER = "t_s,on_time_s,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n"
SCHEDULES = {
    "nothing": "",
    "a column missing": "t_s,on_time_s\n1,2\n",
    "a word": f"{HEADER}1,0,a,0,0\n",
    "a negative width": f"{HEADER}1,-1,1,0,0\n",
    "a start before 0": f"{HEADER}1,4,1,0,0\n",
    "nan": f"{HEADER}nan,0,1,0,0\n",
    "a short row": f"{HEADER}1,0,1\n",
    "a column twice": f"t_s,{HEADER}1,1,0,1,0,0\n",
    "pulses that overlap": SCHEDULE.replace(
        "1,0,steerable,4,0,0", "1,1,+M1,8,0,0\n1.5,1,+M1,8,0,0"
    ),
    "semicolons": SCHEDULE.replace(",", ";"),
}


def test_a_broken_schedule_is_exit_2_with_its_place(run: Run, tmp_path: Path) -> None:
    said = ""
    for name, text in SCHEDULES.items():
        (tmp_path / "broken.csv").write_text(text)
        said += (
            f"{name}: "
            + refusals(run, tmp_path, ["simulate -q --schedule broken.csv --csv track.csv"])
            + "\n"
        )
    check_text("cli.refused.schedules", said)
    (tmp_path / "broken.csv").write_bytes(bytes(range(256)))
    assert refusals(run, tmp_path, ["simulate --schedule broken.csv"])


@pytest.mark.parametrize(
    "command",
    [
        "plan",
        "simulate --scheme none",
        "trade",
        "disperse --samples 10",
        "verify",
        "loop",
        "budget",
        "report -o -",
        "animate -o x.gif",
        "check",
        "export --format json",
    ],
)
def test_every_command_that_reads_a_spacecraft_sets(run: Run, tmp_path: Path, command: str) -> None:
    """A fault of a setting reaches the user from each of them, so each of them reads it."""
    ended = run(
        *command.split(), "-q", "--set", "limits.horizn=3 s", "--set", "mass=-1 kg", status=2
    )
    check_text("cli.refused.set", ended.stderr.removeprefix(BUILT_IN))
    assert "--set KEY=VALUE" in run(command.split()[0], "--help").stdout
    assert contents(tmp_path) == {}

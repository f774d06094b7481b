"""Command lines that are refused, or that name what cannot be read or written: before the work, and nothing written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import BUILT_IN, DATED, EXACT, SCHEDULE, contents, refusals, written
from support.golden import check_text
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

TARGET = "--target 10deg,45deg"
USAGE = {
    "commands": ["fly", "simulatte", "plan --no-such-option", "import aem there.aem", "disperse --resume x.npz",
                 "disperse --flown", "disperse --impulses"],
    "schemes": ["plan --scheme five-pulse", "plan --scheme two-puls", "report --scheme three-pulse"],
    "numbers": ["plan --on-time '20 Hz'", "plan --on-time 0", "simulate --scheme one-pulse --until -1",
                "simulate --scheme one-pulse --until '1 m'", "simulate --scheme one-pulse --samples 1",
                "disperse --samples 0", "disperse --samples -5", "disperse --samples 1.5", "disperse --samples many",
                "disperse --case 0", "disperse --threads 0", "disperse --seed -1", "report --disperse 0",
                "report --disperse nan", "report --disperse 1.5", "report --trade 0",
                "animate -o a.gif --until '-1 s'", "animate -o a.gif --seconds 0", "animate -o a.gif --fps 0",
                "animate -o a.gif --width 10", "export dated.yaml --format aem --until '0 s'",
                "export --format spin-table --scheme none --until '1e9 s'"],
    "angles": ["plan --spin 0rpm", "plan --target 10,45",
               "plan --scheme rhumb-line --target 40deg,0deg --sun 190deg,0deg",
               "report --target 10deg"],
    "settings": ["plan --set mass"],
    "endings": ["plan --plot a.jpg", "plan --plot a", "simulate --scheme one-pulse --plot picture.bmp",
                "disperse --samples 10 --plot x.jpg", "animate -o a.webm", "report -o report.pdf",
                "report -o report.md", "report -o report"],
    "figures": ["plan --plot a.png --figure globe", "disperse --figure cases"],
    "dropped figures": ["plan --plot a.png --figure history", "disperse --plot a.png --figure budget"],
    "left out": ["animate", "import", "export dated.yaml", "export --format apm body.yaml other.yaml"],
    "contradictions": ["plan --scheme one-pulse --scheme two-pulse --csv x.csv",
                       "plan --scheme one-pulse --scheme two-pulse --plot a.png",
                       "simulate --scheme one-pulse --schedule x.csv", "disperse --scheme two-pulse --schedule x.csv",
                       "animate -o a.gif --scheme none --schedule a.csv",
                       "export dated.yaml --format apm --scheme two-pulse --schedule p.csv",
                       "plan --robust --nominal", "report --nominal --disperse 100", "report --disperse --nominal",
                       "report --schedule p.csv --blocks b.csv", "report --scheme optimal --schedule p.csv",
                       "report --schedule p.csv --robust", "report --robust --nominal",
                       "disperse --case 3 --csv x.csv", "export dated.yaml --format stk --xml",
                       "export --format spin-table --scheme none --xml",
                       "export dated.yaml --format apm --until '3 s'"],
    "standard output": ["plan --csv - --json -", "plan --plot - --csv -", "disperse --csv - --json -",
                        "import apm there.apm -o - --schedule -"],
    "options of plan": ["simulate --scheme four-pulse --coarse", "verify --on-time 200ms", "disperse --literal",
                        "animate -o x.gif --cones 3", "export --format json --free-axis", "report --per-turn 2",
                        "trade --shift 1deg"],
    "sun": [f"{command} --sun 70deg,0deg" for command in (
        f"plan --scheme half-cone {TARGET}", "plan", f"simulate --scheme two-pulse {TARGET}", f"trade {TARGET}",
        "simulate dated.yaml --schedule pulses.csv", f"report --scheme optimal {TARGET}")],
    "targets": [*(f"{command} --scheme {scheme}" for scheme in ("half-cone", "rhumb-line")
                  for command in ("plan", "simulate", "verify", "export --format json", "report")),
                "plan --scheme half-cone --scheme rhumb-line"],
    "topics": [f"explain {topic}" for topic in ("tow-pulse", "nutaton", "unitz", "28", "K4", "file.thruster",
                                                "file.horizon", "file.qqq.zzz", "weather")],
    "examples": ["init --from lunar-prospecter", "init --from zzz"],
}  # fmt: skip


@pytest.mark.parametrize("kind", USAGE)
def test_a_bad_command_line_is_exit_2(run: Run, tmp_path: Path, kind: str) -> None:
    written(tmp_path, dated_yaml=DATED, pulses_csv=SCHEDULE)
    check_text(f"cli.refused.{kind}", refusals(run, tmp_path, USAGE[kind]))


TWICE = [
    *(f"plan in.yaml {option} in.yaml" for option in ("--csv", "--json", "--plot")),
    *(f"plan in.yaml --csv {way}" for way in (
        "./in.yaml", "deep/../in.yaml", "FOLDER/in.yaml", "symbolic.yaml", "hard.yaml")),
    "plan symbolic.yaml --csv in.yaml",
    *(f"plan in.yaml --csv new.csv --json {way}" for way in ("new.csv", "deep/../new.csv", "dangling")),
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
]  # fmt: skip


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


def test_what_is_no_file_may_be_named_twice_and_an_output_may_get_the_name_that_is_read_unnamed(run: Run) -> None:
    ended = run("plan", "--scheme", "one-pulse", "--quiet", "--csv", os.devnull, "--json", os.devnull)
    assert (ended.returncode, ended.stderr) == (4, BUILT_IN)
    assert run("plan", "--scheme", "two-pulse", "--quiet", "--csv", "spacecraft.yaml").returncode == 0


@pytest.mark.parametrize(
    "arguments", [["--csv", "out"], pytest.param(["--csv", "-", "--json", "out"], marks=pytest.mark.deep)]
)
def test_standard_output_is_a_purpose_too(tmp_path: Path, arguments: list[str]) -> None:
    with (tmp_path / "out").open("w") as out:
        command = [sys.executable, "-m", "nutdamp", "plan", *arguments]
        ended = subprocess.run(command, cwd=tmp_path, stdout=out, stderr=subprocess.PIPE, text=True, check=False)
    assert ended.returncode == 2
    assert "goes to this file" in ended.stderr


UNREACHABLE = [
    "plan missing.yaml", "check missing.yaml", "report missing.yaml", "export missing.yaml --format apm",
    "simulate --schedule missing.csv", "import apm missing.apm", "plan --json folder", "plan --plot no/x.png",
    "plan --csv no/such/x.csv", "plan --csv no/x.csv", "simulate --scheme none --json no/x.json",
    "trade --points 1000 --csv no/x.csv", "disperse --samples 1e10 --json no/x.json",
    "animate -o no/x.gif --seconds 600", "report -o no/x.html", "export --format json -o no/x.json",
    "export dated.yaml --format apm --scheme two-pulse -o no/x.apm", "verify --json no/x.json",
    "import apm empty.apm -o no/x.yaml",
]  # fmt: skip


def test_what_cannot_be_read_or_written_is_exit_1(run: Run, tmp_path: Path) -> None:
    """Before the work: some of these would take hours."""
    (tmp_path / "folder").mkdir()
    written(tmp_path, dated_yaml=DATED)
    written(tmp_path, empty_apm=run("export", "dated.yaml", "--format", "apm", "--scheme", "none").stdout)
    commands = [f"{command} --quiet" for command in UNREACHABLE]
    check_text("cli.refused.unreachable", refusals(run, tmp_path, commands, 1))


def test_a_bad_file_is_reported_before_a_missing_folder(run: Run, tmp_path: Path) -> None:
    written(tmp_path, bad_yaml="name: 5")
    assert run("plan", "bad.yaml", "--csv", "no/x.csv").returncode == 2


@pytest.mark.skipif(os.name != "posix", reason="links and devices")
def test_a_path_that_cannot_be_is_exit_1(run: Run, tmp_path: Path) -> None:
    (tmp_path / "loop-a").symlink_to("loop-b")
    (tmp_path / "loop-b").symlink_to("loop-a")
    circle, long = ("symlink loop", "too many levels of symbolic links"), ("file name too long",)
    paths = {"loop-a": circle, "loop-a/x.csv": circle, "x" * 300: long, "/".join(["y" * 200] * 25): long}
    for command in ("plan --scheme one-pulse --csv", "simulate --scheme none --json", "init"):
        for path, reasons in paths.items():
            ended = run(*command.split(), path)
            assert ended.returncode == 1
            assert ended.stderr.lower().rstrip("\n").endswith(reasons), command


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no such device")
def test_a_device_is_not_read(run: Run, tmp_path: Path) -> None:
    commands = ["check /dev/zero", "plan /dev/full", "simulate -q --schedule /dev/zero", "import /dev/null"]
    commands.append("fit -q /dev/zero")
    check_text("cli.refused.devices", refusals(run, tmp_path, commands, 1))


def test_an_empty_standard_input_is_a_faulty_file(run: Run, tmp_path: Path) -> None:
    commands = ["plan -", "simulate --schedule - -q", "import apm -"]
    check_text("cli.refused.empty", refusals(run, tmp_path, commands, stdin=""))


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
    "pulses that overlap": SCHEDULE.replace("1,0,steerable,4,0,0", "1,1,+M1,8,0,0\n1.5,1,+M1,8,0,0"),
    "semicolons": SCHEDULE.replace(",", ";"),
}


def test_a_broken_schedule_is_exit_2_with_its_place(run: Run, tmp_path: Path) -> None:
    said = ""
    for name, text in SCHEDULES.items():
        (tmp_path / "broken.csv").write_text(text)
        said += f"{name}: " + refusals(run, tmp_path, ["simulate -q --schedule broken.csv --csv track.csv"]) + "\n"
    check_text("cli.refused.schedules", said)
    (tmp_path / "broken.csv").write_bytes(bytes(range(256)))
    assert refusals(run, tmp_path, ["simulate --schedule broken.csv"])


@pytest.mark.parametrize("command", ["plan", "simulate --scheme none", "trade", "disperse --samples 10", "verify",
    "loop", "budget", "report -o -", "animate -o x.gif", "check", "export --format json"])  # fmt: skip
def test_every_command_that_reads_a_spacecraft_sets(run: Run, tmp_path: Path, command: str) -> None:
    """A fault of a setting reaches the user from each of them, so each of them reads it."""
    ended = run(*command.split(), "-q", "--set", "limits.horizn=3 s", "--set", "mass=-1 kg")
    assert ended.returncode == 2
    check_text("cli.refused.set", ended.stderr.removeprefix(BUILT_IN))
    assert "--set KEY=VALUE" in run(command.split()[0], "--help").stdout
    assert contents(tmp_path) == {}

"""Edges of the command line: paths that cannot be written, inputs that are no files, what is feasible for nobody."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from support import places
from support.process import Run

MANY = 3_000
INFEASIBLE = str(places.case("infeasible.yaml"))


@pytest.mark.skipif(os.name != "posix", reason="links and devices")
@pytest.mark.parametrize("command", ["plan --scheme one-pulse --csv", "simulate --scheme none --json", "init"])
@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("loop-a", ("symlink loop", "too many levels of symbolic links")),
        ("loop-a/x.csv", ("symlink loop", "too many levels of symbolic links")),
        ("x" * 300, ("file name too long",)),
        ("/".join(["y" * 200] * 25), ("file name too long",)),
    ],
)
def test_a_path_that_cannot_be_is_exit_1(
    run: Run, tmp_path: Path, command: str, path: str, said: tuple[str, ...]
) -> None:
    (tmp_path / "loop-a").symlink_to("loop-b")
    (tmp_path / "loop-b").symlink_to("loop-a")
    done = run(*command.split(), path)
    assert done.returncode == 1
    assert any(done.stderr.lower().endswith(f"{words}\n") for words in said), done.stderr


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no such device")
@pytest.mark.parametrize(
    "arguments",
    [
        ("check", "/dev/zero"),
        ("plan", "/dev/full"),
        ("simulate", "--schedule", "/dev/zero"),
        ("fit", "/dev/zero"),
        ("import", "/dev/null"),
    ],
)
def test_a_device_is_not_read(run: Run, arguments: tuple[str, ...]) -> None:
    done = run(*arguments)
    assert done.returncode == 1
    assert "it is a device; expected a file, a pipe or -" in done.stderr


@pytest.mark.parametrize("command", ["plan", "simulate --scheme two-pulse", "verify", "disperse", "trade", "loop"])
def test_where_nothing_is_feasible_the_json_file_says_so(run: Run, tmp_path: Path, command: str) -> None:
    name, *options = command.split()
    points = ("--points", "1") if name == "trade" else ()
    done = run(name, INFEASIBLE, *options, *points, "--json", "out.json")
    assert done.returncode == 3, done.stderr
    written = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert written["spacecraft"]["name"] == "infeasible"
    assert written.get("feasible") is False or written.get("recommended", 0) is None or "fronts" in written


def test_free_motion_that_misses_the_requirement_is_exit_4(run: Run) -> None:
    assert run("simulate", "--scheme", "none", "--set", "requirement={nutation: 1 deg}").returncode == 4


def test_quiet_leaves_warnings_about_the_data(run: Run, tmp_path: Path) -> None:
    (tmp_path / "s.csv").write_text("start_s,on_time_s,channel,torque_1_Nm\n1.0,0.5,+M1,99\n", encoding="utf-8")
    done = run("simulate", "-q", "--schedule", "s.csv", "--set", "state.nutation=0.2")
    assert "state.nutation" in done.stderr
    assert "torque_1_Nm" in done.stderr
    assert "example" not in done.stderr


def test_of_very_many_faults_the_first_hundred_are_shown(run: Run, tmp_path: Path) -> None:
    entries = "".join(f"  - {{name: T{number}, paint: red, torque: [8, 0, 0]}}\n" for number in range(MANY // 10))
    text = f"name: n\ninertia: {{A: 120, C: 80}}\nstate: {{spin: 3, nutation: 5 deg}}\nthrusters:\n{entries}"
    (tmp_path / "f.yaml").write_text(text, encoding="utf-8")
    shown = run("check", "f.yaml").stderr.splitlines()
    assert len(shown) == 101
    assert shown[-1] == "and 200 more faults"


def test_a_message_is_imported_without_naming_its_kind(run: Run, tmp_path: Path) -> None:
    assert run("export", "--format", "apm", "--scheme", "one-pulse", "-o", "m.apm", "--set", EPOCH).returncode == 4
    assert run("import", "m.apm").stdout == run("import", "apm", "m.apm").stdout
    assert run("import", "opm", "m.apm").returncode == 2


EPOCH = "attitude={quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: GCRF}"


def test_a_long_name_leaves_no_warning_of_the_picture(run_apart: Run, tmp_path: Path) -> None:
    done = run_apart("report", str(places.case("long-name.yaml")), "--scheme", "two-pulse", "-o", "r.html")
    assert done.returncode == 0
    assert "Warning" not in done.stderr

"""Names of files that are not UTF-8 stop nothing; where they are shown or written, they are escaped."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest
from support.cases import weekly
from support.process import Run

from nutdamp.files.examples import example_text

ODD = os.fsdecode(b"d\xfcse")
"""A name in Latin-1."""

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes on Linux alone"),
    pytest.mark.usefixtures("plans_shared"),
]


@pytest.fixture
def odd(run: Run, tmp_path: Path) -> str:
    """A spacecraft with an attitude; beside it a schedule, odd as well."""
    attitude = "attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}\n"
    (tmp_path / f"{ODD}.yaml").write_text(example_text() + attitude)
    assert run("plan", f"{ODD}.yaml", "--scheme", "two-pulse", "--csv", f"{ODD}.csv", "--quiet").returncode == 0
    return ODD


@pytest.mark.weekly
@pytest.mark.parametrize(
    "command",
    [
        "plan {0}.yaml --json out.json --plot out.png",
        "check {0}.yaml --json out.json",
        weekly("simulate {0}.yaml --schedule {0}.csv --json out.json --plot out.svg"),
        "verify {0}.yaml --schedule {0}.csv --json out.json",
        "disperse {0}.yaml --schedule {0}.csv --samples 50 --json out.json --plot out.png --csv {0}.out",
        "trade {0}.yaml --points 1 --json out.json --schedules {0}",
        weekly("report {0}.yaml -o {0}.html"),
        weekly("animate {0}.yaml --schedule {0}.csv -o {0}.gif --seconds 0.2 --fps 5 --width 320"),
        "export {0}.yaml --schedule {0}.csv --format apm -o {0}.apm",
        weekly("export {0}.yaml --schedule {0}.csv --format apm -o {0}.xml"),
        "export {0}.yaml --schedule {0}.csv --format aem -o {0}.aem",
        "export {0}.yaml --schedule {0}.csv --format stk -o {0}.a",
        "export {0}.yaml --schedule {0}.csv --format basilisk -o {0}.py",
        "export {0}.yaml --schedule {0}.csv --format json -o out.json",
    ],
)
def test_every_command_takes_names_that_are_not_utf_8(run: Run, tmp_path: Path, odd: str, command: str) -> None:
    done = run(*command.format(odd).split())
    assert done.returncode in (0, 4), done.stderr
    assert "Traceback" not in done.stderr
    if (tmp_path / "out.json").exists():
        json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    for path in tmp_path.iterdir():
        if path.suffix in (".html", ".apm", ".xml", ".aem", ".py"):
            path.read_text(encoding="utf-8")


def test_a_message_of_such_a_name_becomes_a_spacecraft_file(run: Run, tmp_path: Path, odd: str) -> None:
    assert run("export", f"{odd}.yaml", "--format", "apm", "-o", f"{odd}.apm").returncode == 0
    done = run("import", "apm", f"{odd}.apm", "--schedule", "again.csv")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(r"# From the attitude parameter message d\udcfcse.apm; numbers as given there.")
    (tmp_path / "again.yaml").write_text(done.stdout)
    assert run("check", "again.yaml").returncode == 0


def test_json_gives_the_name_back(run: Run, odd: str) -> None:
    done = run("check", f"{odd}.yaml", "missing" + odd, "--json", "-")
    assert [entry["file"] for entry in json.loads(done.stdout)["files"]] == [f"{odd}.yaml", "missing" + odd]
    assert done.stderr == "nutdamp: cannot read missingd\\udcfcse: no such file or directory\n"


def test_messages_show_no_control_characters_of_names(run: Run, tmp_path: Path) -> None:
    name = "\x1b[31mred\n.yaml"
    (tmp_path / name).write_text("name: 5")
    for command in (("check", name), ("plan", name), ("plan", f"missing{name}"), ("plan", "-q", "--csv", f"no/{name}")):
        done = run(*command)
        assert "\x1b" not in done.stderr
        assert "\\x1b[31mred\\n.yaml" in done.stderr

"""No control character of a name, a unit or an option reaches the terminal, whatever file it stands in."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from support.places import case
from support.process import Run

from nutdamp.cli.screen import visible

pytestmark = pytest.mark.usefixtures("plans_shared")

HOSTILE = "\x1b]0;PWNED\x07\x1b[2J\x9b31m"
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029]")
BODY = "name: X\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n"
SCHEDULE = "t_s,on_time_s,channel,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,0,steerable,4,0,0\n"


def test_what_does_not_print_is_shown_as_its_escape() -> None:
    assert visible("a\x1b[2Jb\x07\x7f\x9b\r\u202e\u2028") == r"a\x1b[2Jb\x07\x7f\x9b\r\u202e\u2028"
    assert visible("two lines\nωθ° ×…\n") == "two lines\nωθ° ×…\n"
    assert visible("not UTF-8: \udcff") == r"not UTF-8: \udcff"


def test_channel_names_of_a_schedule_are_printable(run: Run, tmp_path: Path) -> None:
    (tmp_path / "body.yaml").write_text(BODY)
    for command in (("simulate",), ("verify",), ("export", "--format", "json")):
        done = run(*command, "body.yaml", "--schedule", str(case("crash-ansi-channel.csv")))
        assert (done.returncode, done.stdout) == (2, "")
        assert "2:1: channel: '\\x1b]0;PWNED\\x07\\x1b[31mred' is no name of a channel" in done.stderr
        assert not CONTROL.search(done.stderr)


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", f"{HOSTILE}.yaml"),
        ("plan", f"--{HOSTILE}"),
        (HOSTILE,),
        ("plan", "--scheme", HOSTILE),
        ("plan", "--on-time", HOSTILE),
        ("check", f"{HOSTILE}.yaml", "--json", "-"),
        ("plan", "body.yaml", "--scheme", "two-pulse", "--csv", f"no/{HOSTILE}/folder.csv"),
        ("plan", "body.yaml", "--scheme", "two-pulse", "--plot", f"{HOSTILE}.{HOSTILE}"),
        ("simulate", "body.yaml", "--schedule", f"{HOSTILE}.csv"),
        ("simulate", "body.yaml", "--schedule", f"there-{HOSTILE}.csv"),
        ("check", f"there-{HOSTILE}.yaml"),
        ("import", "apm", "message.txt"),
        ("import", "apm", f"there-{HOSTILE}.csv"),
    ],
    ids=lambda arguments: " ".join(arguments).replace(HOSTILE, "HOSTILE"),
)
def test_names_of_files_units_and_options_are_shown_with_escapes(
    run: Run, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    (tmp_path / "body.yaml").write_text(BODY)
    (tmp_path / f"there-{HOSTILE}.csv").write_text(SCHEDULE)
    (tmp_path / f"there-{HOSTILE}.yaml").write_text(BODY.replace("inertia", "inetria") + f'"{HOSTILE}": 1\n')
    (tmp_path / "message.txt").write_text(
        f"CCSDS_APM_VERS = 2.0\nCREATION_DATE = 2026-03-01T12:00:00\nORIGINATOR = X\nIXX = 120 [{HOSTILE}]\n"
    )
    done = run(*arguments)
    assert not CONTROL.search(done.stdout + done.stderr)
    if arguments[-1].startswith("there") and arguments[0] == "simulate":
        assert done.returncode == 0
    else:
        assert done.returncode in (1, 2)
        assert done.stderr


def test_json_on_standard_output_escapes_them(run: Run, tmp_path: Path) -> None:
    name = f"there-{HOSTILE}.yaml"
    (tmp_path / name).write_text(BODY)
    done = run("check", name, "--json", "-")
    assert done.returncode == 0
    assert not CONTROL.search(done.stdout + done.stderr)
    assert json.loads(done.stdout)["files"][0]["file"] == name

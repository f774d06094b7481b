"""``check``, ``init``, ``schema``, help and version as processes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from support import places
from support.cases import spread
from support.process import Run

from nutdamp import __version__
from nutdamp.cli.root import COMMANDS

pytestmark = pytest.mark.usefixtures("plans_shared")

GOOD = "name: Good\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"
TYPO = "name: Typo\ninertia: {A: 120, c: 80}\nomega0: [0.1, 0, 3]\n"
TENSOR = """
name: Tilted
inertia: {tensor: [[120, 0, 2], [0, 118, 0], [2, 0, 80]]}
omega0: [0.1, 0, 3]
thrusters: [{name: T1, torque: [0, 8, 0], min_on_time: 20 ms}, {name: SPIN, torque: [0, 0, 5]}]
"""


def test_init_writes_a_file_that_plans(run: Run, tmp_path: Path) -> None:
    assert run("init").returncode == 0
    assert run("plan").returncode == 0
    again = run("init")
    assert again.returncode == 1
    assert "--force" in again.stderr
    (tmp_path / "spacecraft.yaml").write_text("mine")
    assert run("init", "--force").returncode == 0
    assert run("plan").returncode == 0
    assert run("init", "other.yaml").returncode == 0
    assert run("init", "-").stdout == (tmp_path / "other.yaml").read_text()


def test_init_lists_the_spacecraft_that_ship_with_nutdamp(run: Run, tmp_path: Path) -> None:
    shown = run("init", "--list").stdout
    configs = [path.stem for path in (places.CONFIGS).glob("*.yaml")]
    assert configs
    assert [name for name in configs if name not in shown] == []
    assert list(tmp_path.iterdir()) == []


def test_init_writes_the_one_that_is_named(run: Run, tmp_path: Path) -> None:
    assert run("init", "--from", "ace", "mine.yaml").returncode == 0
    assert (tmp_path / "mine.yaml").read_bytes() == (places.CONFIGS / "ace.yaml").read_bytes()
    assert "ACE" in run("check", "mine.yaml").stdout


def test_init_names_the_nearest_of_the_examples(run: Run, tmp_path: Path) -> None:
    done = run("init", "--from", "lunar-prospecter")
    assert done.returncode == 2
    assert "there is no example 'lunar-prospecter'; did you mean 'lunar-prospector'?" in done.stderr
    assert "--list" in run("init", "--from", "zzz").stderr
    assert list(tmp_path.iterdir()) == []


def test_check_prints_derived_quantities(run: Run) -> None:
    done = run("check")
    assert done.returncode == 0
    for text in ("a = 0.3333", "nutation period", "smallest step", "deg apart about axis 3", "come nearest to that"):
        assert text in done.stdout


def test_check_shows_all_faults_of_all_files(run: Run, tmp_path: Path) -> None:
    for name, text in (("good.yaml", GOOD), ("typo.yaml", TYPO), ("tensor.yaml", TENSOR)):
        (tmp_path / name).write_text(text)
    done = run("check", "typo.yaml", "good.yaml", "missing.yaml", "tensor.yaml", "--json", "check.json")
    assert done.returncode == 2  # a bad file counts before one that cannot be read
    assert "typo.yaml:2:" in done.stderr
    assert "missing.yaml" in done.stderr
    assert "Good" in done.stdout
    assert "principal axis 1" in done.stdout
    assert "SPIN" in done.stdout
    files = json.loads((tmp_path / "check.json").read_text())["files"]
    assert [entry["valid"] for entry in files] == [False, True, False, True]
    assert files[0]["faults"][0]["line"] == 2
    assert files[3]["channels"][1]["damps"] is False
    axes = files[3]["spacecraft"]["principal_axes"]
    assert axes[0][2] == pytest.approx(-axes[2][0], abs=1e-12)  # the tilt about axis 2


LATE = """
import sys
from nutdamp import errors, survey
from nutdamp.cli import main

found = survey.spin_axis

def late(spacecraft):
    if spacecraft.name == "Typo":
        raise errors.Infeasible("the motion changes too fast to be integrated")
    return found(spacecraft)

survey.spin_axis = late
sys.argv = ["nutdamp", "check", "typo.yaml", "good.yaml", "--json", "check.json"]
main()
"""


def test_check_goes_on_after_what_turns_out_late(tmp_path: Path) -> None:
    for name, text in (("good.yaml", GOOD), ("typo.yaml", TYPO.replace("c:", "C:"))):
        (tmp_path / name).write_text(text)
    done = subprocess.run([sys.executable, "-c", LATE], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "typo.yaml:1:1: the motion changes too fast to be integrated\n"
    assert "Good" in done.stdout
    files = json.loads((tmp_path / "check.json").read_text())["files"]
    assert [entry["valid"] for entry in files] == [False, True]
    assert files[0]["faults"][0]["problem"] == "the motion changes too fast to be integrated"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_bad_file_counts_before_a_report_that_cannot_be_written(run: Run, tmp_path: Path) -> None:
    (tmp_path / "typo.yaml").write_text(TYPO)
    (tmp_path / "good.yaml").write_text(GOOD)
    assert run("check", "good.yaml", "typo.yaml", "--json", "/dev/full").returncode == 2
    assert run("check", "good.yaml", "--json", "/dev/full").returncode == 1


@pytest.mark.usefixtures("plain_pages")
def test_check_reports_warnings_on_screen_and_in_json(run: Run, tmp_path: Path) -> None:
    (tmp_path / "fast.yaml").write_text(GOOD.replace("3]", "300]"))
    done = run("check", "fast.yaml", "--json", "check.json")
    place = "fast.yaml:3:18: omega0[2]: warning: "
    problem = "300 is read as 300 rad/s; write 300 deg/s if that is meant, else 300 rad/s"
    assert (done.returncode, done.stderr) == (0, f"{place}{problem}\n")
    (found,) = json.loads((tmp_path / "check.json").read_text())["files"]
    assert found["valid"]
    (warned,) = found["warnings"]
    assert warned.pop("place").endswith(".yaml:3:18")
    assert warned == {"line": 3, "column": 18, "where": "omega0[2]", "problem": problem}
    for command in (("plan",), ("simulate", "--scheme", "none"), ("report",), ("verify",)):
        assert run(command[0], "fast.yaml", *command[1:]).stderr.startswith(place)
    assert run("check", "fast.yaml", "--quiet").stderr == f"{place}{problem}\n"


def test_a_missing_file_alone_is_exit_1(run: Run) -> None:
    assert run("check", "missing.yaml").returncode == 1


def test_a_misspelt_inertia_stops_the_run(run: Run, tmp_path: Path) -> None:
    (tmp_path / "typo.yaml").write_text(TYPO)
    for command in (("plan",), ("simulate", "--scheme", "none"), ("check",)):
        done = run(command[0], "typo.yaml", *command[1:])
        assert done.returncode == 2
        assert "did you mean" in done.stderr
        assert done.stdout == ""


def test_schema_is_json(run: Run, tmp_path: Path) -> None:
    schema = json.loads(run("schema").stdout)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert run("schema", "-o", "s.json").stdout == ""
    assert json.loads((tmp_path / "s.json").read_text()) == schema


def test_version(run: Run) -> None:
    assert __version__ in run("--version").stdout


@pytest.mark.parametrize("arguments", [(), *((command,) for command in COMMANDS)])
@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_every_help_page_fits_80_columns(run: Run, arguments: tuple[str, ...], flag: str) -> None:
    done = run(*arguments, flag)
    assert done.returncode == 0
    assert done.stdout.startswith("Usage: ")
    assert max(len(line) for line in done.stdout.splitlines()) <= 80


def test_help_loads_click_only(run: Run) -> None:
    code = (
        "import sys\nfrom nutdamp.cli.root import group\ngroup.main(['--help'], standalone_mode=False)\n"
        "print(sorted({'numpy', 'scipy', 'yaml', 'pydantic', 'rich', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


LEAN = (
    "plan",
    "plan --scheme optimal --free-axis",
    "disperse --samples 100",
    "simulate --scheme optimal",
)
"""Commands that run without heavy packages; the first two also without masked arrays."""

LEAN_TOO = (
    "plan --scheme optimal --least time",
    "plan --target 10deg,20deg",
    "plan --robust --scheme one-pulse",
    "trade --points 2",
    "disperse --samples 100 --scheme optimal",
)


@pytest.mark.deep
@spread("lean", [LEAN, LEAN_TOO], quick=1, deep=0)
def test_planning_a_symmetric_body_loads_no_scipy_and_no_matplotlib(lean: tuple[str, ...]) -> None:
    """One process runs them all. numpy.ma, as `numpy.unique` loads it, is a tenth of the start-up of a command."""
    unmasked = 2 * (lean is LEAN)
    code = (
        "import contextlib, sys\nfrom nutdamp.cli.root import group\n"
        f"for number, words in enumerate({lean!r}):\n"
        "    with contextlib.suppress(SystemExit): group.main([*words.split(), '-q'], standalone_mode=False)\n"
        f"    masked = ['numpy.ma'] if number < {unmasked} else []\n"
        "    heavy = {'scipy', 'matplotlib', 'pydantic', 'jinja2', *masked}\n"
        "    print('LOADED by', words, *sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = [line for line in done.stdout.splitlines() if line.startswith("LOADED by")]
    assert loaded == [f"LOADED by {words}" for words in lean]


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (("plan", "--csv", "x"), "got a schedule, as `plan --csv` writes it; name it with --schedule"),
        (("simulate", "--scheme", "four-pulse", "--csv", "x"), "got a track, as `simulate --csv` writes it"),
        (("plan", "--json", "x"), "got a result in JSON, as nutdamp writes it"),
    ],
)
def test_a_file_of_another_kind_is_called_what_it_is(run: Run, written: tuple[str, ...], said: str) -> None:
    """Their faults, such as a text where a mapping is expected, named no cure."""
    assert run(*written).returncode == 0
    done = run("plan", "x")
    assert done.returncode == 2
    assert done.stderr.startswith("x:1:1: expected a spacecraft file, ")
    assert said in done.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("COMMENT a\nCCSDS_APM_VERS = 2.0\n", "`nutdamp import FILE`"),
        ('<?xml version="1.0"?>\n<apm id="CCSDS_APM_VERS" version="2.0">\n', "another XML or HTML text"),
        ("CCSDS_OEM_VERS = 2.0\n", "another XML or HTML text"),
    ],
)
def test_a_ccsds_message_is_called_that(run: Run, tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "x").write_text(text)
    done = run("check", "x")
    assert done.returncode == 2
    assert said in done.stderr


def test_every_message_about_a_missing_file_has_the_name_of_the_program(run: Run) -> None:
    for command in ("check", "plan"):
        assert run(command, "nope.yaml").stderr == "nutdamp: cannot read nope.yaml: no such file or directory\n"


@pytest.mark.parametrize(
    ("words", "warning"),
    [
        (("plan", "--spin", "31"), "--spin: warning: 31 is read as 31 rad/s; write 31 rpm if that is meant"),
        (("plan", "--spin", "3.25"), None),
        (("plan", "--spin", "31 rad/s"), None),
        (
            ("trade", "--points", "1", "--allow", "0.1"),
            "--allow: warning: 0.1 is read as 0.1 rad (5.73 deg); write 0.1",
        ),
        (("trade", "--points", "1", "--allow", "0.1deg"), None),
        (("trade", "--points", "1", "--allow", "0"), None),
    ],
)
def test_numbers_without_unit_that_are_hardly_meant_are_named(
    run: Run, words: tuple[str, ...], warning: str | None
) -> None:
    said = run(*words, "--set", "limits.horizon=10ms").stderr  # too short for any plan: it is read first
    assert "is read as" not in said if warning is None else warning in said


def test_products_of_small_matrices_have_one_thread() -> None:
    """Unless the environment says otherwise."""
    import os
    import subprocess
    import sys

    code = "import os, sys\nfrom nutdamp.cli import main\nsys.argv = ['nutdamp', '--version']\ntry: main()\nfinally: "
    code += "print(os.environ['OPENBLAS_NUM_THREADS'])"
    for given, used in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")):
        kept = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**kept, **given}
        )
        assert done.stdout.splitlines()[-1] == used

"""Pictures by command: plan --plot, simulate --plot and --show, animate; as processes."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.cases import spread
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

IDEAL = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"


def left(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.deep
@spread(("ending", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml")], quick=1, deep=0)
def test_plan_draws_the_motion(run: Run, tmp_path: Path, ending: str, magic: bytes) -> None:
    done = run("plan", "--plot", f"motion.{ending}")
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert (tmp_path / f"motion.{ending}").read_bytes().startswith(magic)
    assert left(tmp_path) == [f"motion.{ending}"]


def test_another_figure_can_be_chosen(run: Run, tmp_path: Path) -> None:
    for figure in ("sphere", "timeline"):
        assert run("simulate", "--scheme", "none", "--plot", f"{figure}.png", "--figure", figure).returncode == 4
    assert len({path.read_bytes() for path in tmp_path.iterdir()}) == 2
    assert run("plan", "--plot", "a.png", "--figure", "globe").returncode == 2


def test_plan_draws_the_plan_that_it_recommends(run: Run, tmp_path: Path) -> None:
    """optimal for the built-in example: the same picture as that scheme alone, and not that of another."""
    run("plan", "--plot", "recommended.png", "--figure", "timeline")
    run("plan", "--scheme", "optimal", "--plot", "optimal.png", "--figure", "timeline")
    run("plan", "--scheme", "two-pulse", "--plot", "two.png", "--figure", "timeline")
    recommended, optimal, two = ((tmp_path / f"{name}.png").read_bytes() for name in ("recommended", "optimal", "two"))
    assert recommended == optimal
    assert recommended != two


@pytest.mark.deep
def test_plan_draws_all_schemes_beside_each_other(run: Run, tmp_path: Path) -> None:
    """Also where several are named, of which no other picture could be drawn, and where none is feasible."""
    named = ("--scheme", "one-pulse", "--scheme", "two-pulse")
    assert run("plan", *named, "--plot", "schemes.svg", "--figure", "schemes").returncode == 0
    words = re.findall(r"<text[^>]*>([^<]*)</text>", (tmp_path / "schemes.svg").read_text(encoding="utf-8"))
    assert {"one-pulse", "two-pulse", "propellant, g", "required"} <= set(words)
    (tmp_path / "ideal.yaml").write_text(IDEAL)
    none = run("plan", "ideal.yaml", "--scheme", "four-pulse", "--plot", "none.svg", "--figure", "schemes")
    assert none.returncode == 3
    assert "no plan" in (tmp_path / "none.svg").read_text(encoding="utf-8")


@pytest.mark.deep
def test_robust_plans_are_drawn_with_the_cases_that_comply(run: Run, tmp_path: Path) -> None:
    named = ("--scheme", "two-pulse", "--robust", "-q")
    run("plan", *named, "--plot", "schemes.svg", "--figure", "schemes")
    assert "complying cases, %" in (tmp_path / "schemes.svg").read_text(encoding="utf-8")


@pytest.mark.weekly
def test_disperse_draws_what_is_named(run: Run, tmp_path: Path) -> None:
    common = ("disperse", "--scheme", "two-pulse", "--samples", "200", "-q")
    said = {"cases": "cases beyond, %", "momentum": "H towards you, inertial x to the right", "budget": "A, 0.6 kg m²"}
    for figure, words in said.items():
        run(*common, "--plot", f"{figure}.svg", "--figure", figure)
        assert words in (tmp_path / f"{figure}.svg").read_text(encoding="utf-8")
    run(*common, "--plot", "all.svg")
    assert all(words in (tmp_path / "all.svg").read_text(encoding="utf-8") for words in said.values())
    assert run("disperse", "--figure", "cases").returncode == 2


def test_a_film_ends_soon_after_the_last_pulse(run: Run, tmp_path: Path) -> None:
    """7.434 s, a quarter of that, in half a second of film."""
    done = run("animate", "--scheme", "two-pulse", "-o", "a.gif", "--seconds", "0.5", "--fps", "10", "--width", "320")
    assert "5 frames, 18.6 s of motion in a second" in done.stderr
    assert left(tmp_path) == ["a.gif"]


@pytest.mark.deep
def test_standard_output_takes_the_picture_alone(run: Run) -> None:
    environment = {**os.environ, "COLUMNS": "80"}
    command = [sys.executable, "-m", "nutdamp", "plan", "-q", "--plot", "-", "--figure", "timeline"]
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    assert done.returncode == 0
    assert done.stdout.startswith(b"\x89PNG")
    assert done.stdout.endswith(b"IEND\xaeB`\x82")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("plan", "--plot", "a.jpg"), ".png, .svg, .pdf"),
        (("plan", "--plot", "a"), ".png, .svg, .pdf"),
        (("plan", "--scheme", "one-pulse", "--scheme", "two-pulse", "--plot", "a.png"), "name one --scheme"),
        (("plan", "--plot", "-", "--csv", "-"), "cannot both go to standard output"),
        (("simulate", "--scheme", "none", "--show", "--csv", "-"), "--show draws on standard output"),
        (("animate",), "--output"),
        (("animate", "-o", "a.webm"), ".gif, .mp4"),
        (("animate", "-o", "a.gif", "--until", "-1 s"), "after t = 0"),
        (("animate", "-o", "a.gif", "--seconds", "0"), "--seconds"),
        (("animate", "-o", "a.gif", "--fps", "0"), "--fps"),
        (("animate", "-o", "a.gif", "--width", "10"), "--width"),
        (("animate", "-o", "a.gif", "--scheme", "none", "--schedule", "a.csv"), "--schedule and --blocks"),
    ],
)
def test_bad_command_lines_are_exit_2_and_write_nothing(
    run: Run, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    done = run(*arguments)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert left(tmp_path) == []


@pytest.mark.parametrize("arguments", [("plan", "--plot"), ("animate", "--seconds", "0.2", "--fps", "5", "-o")])
def test_an_unwritable_place_is_exit_1(run: Run, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    done = run(*arguments, "missing/film.gif" if arguments[0] == "animate" else "missing/a.png")
    assert done.returncode == 1
    assert "cannot write missing/" in done.stderr
    assert "Traceback" not in done.stderr
    assert left(tmp_path) == []


def test_an_infeasible_plan_has_no_picture(run: Run, tmp_path: Path) -> None:
    (tmp_path / "ideal.yaml").write_text(IDEAL)
    done = run("plan", "ideal.yaml", "--scheme", "four-pulse", "--plot", "a.png")
    assert done.returncode == 3
    assert "a.png was not written" in done.stderr
    film = run("animate", "ideal.yaml", "--scheme", "four-pulse", "-o", "a.gif")
    assert film.returncode == 3
    assert left(tmp_path) == ["ideal.yaml"]


def without(package: str, tmp_path: Path, *arguments: str, more: str = "") -> subprocess.CompletedProcess[str]:
    """Run with an installation that lacks ``package``; ``more`` is run before."""
    blocked = (
        f"import sys; sys.modules[{package!r}] = None; from nutdamp.cli import main; sys.argv[0] = 'nutdamp'; {more}"
        "\nmain()"
    )
    command = [sys.executable, "-c", blocked, *arguments]
    return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)


@pytest.mark.deep
@pytest.mark.parametrize(
    "arguments",
    [("plan", "--plot", "a.png"), ("simulate", "--scheme", "none", "--plot", "a.svg"), ("animate", "-o", "a.gif")],
)
def test_without_matplotlib_it_is_exit_1_at_once_with_the_cure(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    done = without("matplotlib", tmp_path, *arguments)
    assert done.returncode == 1
    assert "pip install 'nutdamp[plot]'" in done.stderr
    assert done.stdout == ""
    assert left(tmp_path) == []


@pytest.mark.deep
@spread("output", ["report.html", "-"], quick=1)
@pytest.mark.parametrize("package", ["matplotlib", "jinja2"])
def test_what_a_report_lacks_is_said_before_the_work(tmp_path: Path, output: str, package: str) -> None:
    """No file is read, and no plan is made: what would make it is not there."""
    no_plans = "import nutdamp.comparison; nutdamp.comparison.compare = None"
    done = without(package, tmp_path, "report", "missing.yaml", "-o", output, more=no_plans)
    assert done.returncode == 1
    assert "pip install 'nutdamp[plot]'" in done.stderr
    assert "Traceback" not in done.stderr
    assert left(tmp_path) == []


def test_the_terminal_drawing_needs_no_matplotlib(tmp_path: Path) -> None:
    done = without("matplotlib", tmp_path, "simulate", "--scheme", "two-pulse", "--show")
    assert done.returncode == 0
    assert "Axis track" in done.stdout


@pytest.mark.parametrize("columns", [80, 140])
def test_show_draws_below_the_tables(run: Run, columns: int) -> None:
    plain = run("simulate", "--scheme", "two-pulse", columns=columns).stdout
    shown = run("simulate", "--scheme", "two-pulse", "--show", columns=columns).stdout
    assert shown.startswith(plain)
    drawn = shown.removeprefix(plain).splitlines()
    assert all(len(line) <= columns for line in drawn)
    assert max(len(line.rstrip()) for line in drawn) > 0.9 * columns
    assert any("⠁" <= sign <= "⣿" for line in drawn for sign in line)
    assert "\x1b" not in shown


def test_a_film_is_written_whole(run: Run, tmp_path: Path) -> None:
    done = run(
        "animate", "--scheme", "two-pulse", "-o", "film.gif", "--seconds", "0.5", "--fps", "10", "--width", "320"
    )
    assert done.returncode == 0
    assert (tmp_path / "film.gif").read_bytes().startswith(b"GIF89a")
    assert left(tmp_path) == ["film.gif"]
    assert "wrote film.gif: 5 frames" in done.stderr
    assert "frames show a nutation turn" in done.stderr  # 5 of them for 3.5 turns
    assert done.stdout == ""


def test_a_film_of_a_schedule_file(run: Run, tmp_path: Path) -> None:
    run("plan", "--scheme", "two-pulse", "--csv", "pulses.csv")
    done = run("animate", "--schedule", "pulses.csv", "-q", "-o", "a.gif", "--seconds", "0.2", "--fps", "10")
    assert done.returncode == 0
    assert done.stderr == ""
    assert (tmp_path / "a.gif").exists()

"""Pictures by command: --plot and --figure, films by animate, and pages by report."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from support import places
from support.cases import deep, spread, weekly
from support.commands import (
    EXACT,
    call,
    contents,
    names,
    python,
)
from support.golden import check_text
from support.process import Run
from support.shown import downloaded, parsed

from nutdamp.figures import image, style
from nutdamp.flight.propagation import Flight
from nutdamp.page import report
from nutdamp.page.document import Prose

pytestmark = pytest.mark.usefixtures("plans_shared")

FILM = ("--seconds", "0.5", "--fps", "10", "--width", "320")


@pytest.mark.deep
@spread(
    ("ending", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")], quick=1, deep=0
)
def test_the_ending_says_the_format(run: Run, tmp_path: Path, ending: str, magic: bytes) -> None:
    pytest.importorskip("matplotlib")
    assert (
        call(run, f"simulate --scheme two-pulse --figure motion --plot a.{ending}").returncode == 0
    )
    assert (
        call(run, f"plan --nominal --scheme two-pulse --figure motion --plot b.{ending}").returncode
        == 0
    )
    disperse = "disperse --scheme four-pulse --samples 200 --figure cases"
    assert call(run, f"{disperse} --plot c.{ending}").returncode == 4
    assert names(tmp_path) == [f"{name}.{ending}" for name in "abc"]
    assert all(content.startswith(magic) for content in contents(tmp_path).values())


@pytest.mark.deep
def test_plan_draws_the_recommended_plan_alone_and_simulate_another_figure(
    run: Run, tmp_path: Path
) -> None:
    """two-pulse for the built-in example: the same picture as that scheme alone, and not that of
    another.

    By nominal values it is optimal.
    """
    draw = ("--figure", "motion", "--plot")
    for name, options in {
        "recommended": "",
        "two": "--scheme two-pulse",
        "cheapest": "--nominal",
        "optimal": "--nominal --scheme optimal",
    }.items():
        run("plan", *options.split(), *draw, f"{name}.png")
    for figure in ("motion", "overview"):
        assert (
            run(
                "simulate", "--scheme", "none", "--plot", f"{figure}.png", "--figure", figure
            ).returncode
            == 4
        )
    drawn = contents(tmp_path)
    assert drawn["recommended.png"] == drawn["two.png"]
    assert drawn["cheapest.png"] == drawn["optimal.png"]
    assert len(set(drawn.values())) == 4


@pytest.mark.deep
def test_standard_output_takes_the_picture_alone() -> None:
    command = [
        sys.executable,
        "-m",
        "nutdamp",
        "plan",
        "-q",
        "--nominal",
        "--plot",
        "-",
        "--figure",
        "motion",
    ]
    ended = subprocess.run(
        command, env={**os.environ, "COLUMNS": "80"}, capture_output=True, check=True
    )
    assert ended.stdout.startswith(b"\x89PNG")
    assert ended.stdout.endswith(b"IEND\xaeB`\x82")


def test_a_film_is_written_whole_and_ends_soon_after_the_last_pulse(
    run: Run, tmp_path: Path
) -> None:
    """7.434 s, a quarter of that, in half a second of film:
    5 frames for 3.5 turns of the nutation.
    """
    ended = run("animate", "--scheme", "two-pulse", "-o", "film.gif", *FILM)
    assert (ended.returncode, ended.stdout) == (0, "")
    said = re.sub(".* done after .*\n", "", ended.stderr)  # how far it is, where it takes long
    check_text("cli.pictures.film", said)
    assert (tmp_path / "film.gif").read_bytes().startswith(b"GIF89a")
    assert names(tmp_path) == ["film.gif"]


@pytest.mark.deep
def test_figure_film_and_page_name_the_plan_that_they_show(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lunar Prospector flies command blocks, though optimal costs less."""
    captions: list[str] = []

    def captioned(_: object, flight: Flight, timed: image.Timing, *__: object) -> None:
        captions.append(style.styled()(image.Scene)(flight, timed, 320).caption(0.0))

    monkeypatch.setattr(image, "film", captioned)
    craft = str(places.CONFIGS / "lunar-prospector.yaml")
    for command in (
        "plan --plot a.svg",
        "animate -o a.gif --seconds 0.5",
        "report -o a.html",
        "plan --csv p.csv",
    ):
        name, *options = command.split()
        assert run(name, craft, "-q", *options).returncode == 0
    assert [caption.split("\n")[0] for caption in captions] == ["Lunar Prospector: command-block"]
    assert (
        "Lunar Prospector: command-block by real pulse widths" in (tmp_path / "a.svg").read_text()
    )
    page = parsed((tmp_path / "a.html").read_text(encoding="utf-8"))
    assert "Motion: command-block" in page.text
    shown = [node.text for node in page.all("p") if node.attributes.get("class") == "how"]
    assert "--scheme command-block" in shown[-1].replace("\n", " ")
    assert (
        run(
            "animate", craft, "-q", "--schedule", "p.csv", "-o", "b.gif", "--seconds", "0.5"
        ).returncode
        == 0
    )
    assert captions[1].startswith("Lunar Prospector: p.csv\n")
    assert (
        run("report", craft, "-q", "--schedule", "p.csv", "-o", "b.html").returncode == 4
    )  # single pulses
    assert "--scheme p.csv" not in parsed((tmp_path / "b.html").read_text(encoding="utf-8")).text


LACKING = """
import sys
sys.modules[{package!r}] = None
from nutdamp.cli.main import main
import nutdamp.planning.decision
sys.argv = ["nutdamp", *{words!r}]
nutdamp.planning.decision.compare = None
main()
"""


@pytest.mark.parametrize(
    ("package", "command"),
    [
        ("matplotlib", "plan --plot a.png"),
        deep("matplotlib", "simulate --scheme none --plot a.svg"),
        deep("matplotlib", "animate -o a.gif"),
        deep("matplotlib", "report missing.yaml -o report.html"),
        deep("jinja2", "report missing.yaml -o report.html"),
        weekly("jinja2", "report missing.yaml -o -"),
    ],
)
def test_what_is_not_installed_is_exit_1_with_the_cure_before_the_work(
    tmp_path: Path, package: str, command: str
) -> None:
    """No file is read, and no plan is made: what would make it is not there."""
    ended = python(tmp_path, LACKING.format(package=package, words=command.split()), status=1)
    assert "pip install 'nutdamp[plot]'" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert (ended.stdout, names(tmp_path)) == ("", [])


# --- report
# --------------------------------------------------------------------------------------------------


def verdict_of(folder: Path, kind: str) -> str:
    """The decision on the page, which is of that kind: met, caution or missed."""
    tree = parsed((folder / "report.html").read_text(encoding="utf-8"))
    (decision,) = (node for node in tree.all("section") if node.attributes["id"] == "decision")
    assert decision.attributes["class"] == kind
    return decision.text


@pytest.mark.weekly
@pytest.mark.usefixtures("plain_pages")
def test_what_is_repeated_gives_the_same_page(run: Run, tmp_path: Path) -> None:
    (tmp_path / "my craft.yaml").write_text(run("init", "-").stdout)
    assert run("report", "my craft.yaml", "-q", "--with-disturbances").returncode == 0
    first = (tmp_path / "report.html").read_text(encoding="utf-8")
    *_, command = (node.text for node in parsed(first).all("pre"))
    assert command == "nutdamp report 'my craft.yaml' -q --with-disturbances"
    (link,) = parsed(first).all("a")
    (tmp_path / "my craft.yaml").write_text(downloaded(link))
    assert run(*shlex.split(command)[1:]).returncode == 0
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == first


@pytest.mark.usefixtures("plain_pages")
@pytest.mark.parametrize(
    "options",
    [
        "--set omega0=[0.2,0,3] --target 10deg,45deg",
        deep("--target 0.3,-0.2 --spin 28.65rpm"),
        "--spin keep",
    ],
)
def test_commands_of_a_page_fly_the_spacecraft_of_its_own(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: str
) -> None:
    crafts: list[str] = []

    def view(_: object, craft: str, outlines: object) -> Prose:
        crafts.append(craft)
        return Prose("")

    monkeypatch.setattr(report, "moving_of", view)
    (tmp_path / "my craft.yaml").write_text(EXACT, encoding="utf-8")
    assert run("report", "my craft.yaml", "--scheme", "two-pulse", *options.split()).returncode in (
        0,
        4,
    )
    assert run("report", "-", "--scheme", "two-pulse", stdin=EXACT).returncode == 0
    named, read = crafts
    assert read == "SPACECRAFT"
    usual = ["my craft.yaml", *options.split()]
    assert (
        run(
            "plan", *usual, "--nominal", "--scheme", "two-pulse", "--csv", "edited.csv", "-q"
        ).returncode
        == 0
    )
    for pulses in (["--scheme", "two-pulse"], ["--schedule", "edited.csv"]):
        flown, repeated = (
            json.loads(run("simulate", *words, *pulses, "--flown", "--json", "-").stdout)
            for words in (usual, shlex.split(named))
        )
        assert repeated == flown


@pytest.mark.usefixtures("plain_pages")
def test_standard_output_holds_the_page_alone(run: Run, tmp_path: Path) -> None:
    ended = run("report", "-", "--scheme", "four-pulse", "-o", "-", stdin=EXACT)
    assert ended.stdout.startswith("<!DOCTYPE html>")
    assert ended.stdout.endswith("</html>\n")
    (link,) = parsed(ended.stdout).all("a")
    assert (link.attributes["download"], downloaded(link)) == ("spacecraft.yaml", EXACT)
    assert "wrote" not in ended.stderr
    assert names(tmp_path) == []


@pytest.mark.weekly
@pytest.mark.usefixtures("plain_pages")
def test_a_page_with_the_robust_plan_recommends_what_plan_robust_does(
    run: Run, tmp_path: Path
) -> None:
    craft = str(places.case("rob2.yaml"))
    data = json.loads(run("plan", craft, "--robust", "--json", "-").stdout)
    assert run("report", craft, "--robust").returncode == 0
    assert (
        f"{100.0 * data['robust']['recommended']['met_fraction']:.2f} % of cases comply"
        in verdict_of(tmp_path, "met")
    )


@pytest.mark.weekly
def test_a_long_name_leaves_no_warning_of_the_picture(run_apart: Run) -> None:
    ended = run_apart(
        "report",
        str(places.case("long-name.yaml")),
        "--scheme",
        "two-pulse",
        "-o",
        "r.html",
        status=0,
    )
    assert "Warning" not in ended.stderr


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_what_steers_a_terminal_is_escaped_on_a_page(run: Run, tmp_path: Path) -> None:
    name = "a\x1b[31m\nb.yaml"
    (tmp_path / name).write_text(EXACT)
    ended = run("report", name, "--scheme", "four-pulse", "-o", f"{name}.html")
    page = (tmp_path / f"{name}.html").read_text(encoding="utf-8")
    assert "\x1b" not in page
    assert "a\\x1b[31m\\nb.yaml" in page
    assert "a\\x1b[31m\\nb.yaml.html" in ended.stderr

"""``nutdamp report`` as a process: what it writes, and that it writes nothing where it cannot."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from support.cases import spread
from support.markup import parsed
from support.process import Run

from nutdamp import __version__

pytestmark = pytest.mark.usefixtures("plans_shared")

IDEAL = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"


@pytest.mark.weekly
def test_a_page_of_the_example_tells_how_to_repeat_it(run: Run, tmp_path: Path) -> None:
    done = run("report", "--scheme", "two-pulse")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "built-in example" in done.stderr
    assert done.stderr.endswith("wrote report.html\n")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert '<pre>nutdamp report <span class="whole-word">--scheme</span> two-pulse</pre>' in text
    assert f'<th scope="row">nutdamp</th><td>{__version__}</td>' in text
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.weekly
@pytest.mark.usefixtures("plain_pages")
def test_trade_may_come_without_a_number(run: Run, tmp_path: Path) -> None:
    """A file may follow it, and a number of points."""
    (tmp_path / "craft.yaml").write_text(run("init", "-").stdout)
    for given in (("--trade", "2"), ("craft.yaml", "--trade"), ("--trade", "craft.yaml")):
        assert run("report", "-q", "-o", "a.html", *given).returncode == 0
        text = parsed((tmp_path / "a.html").read_text(encoding="utf-8")).text
        assert "Time against cost" in text
        assert "first-order least" in text
    assert run("report", "--trade", "0").returncode == 2


@pytest.mark.weekly
def test_what_is_repeated_gives_the_same_page(run: Run, tmp_path: Path) -> None:
    (tmp_path / "my craft.yaml").write_text(run("init", "-").stdout)
    assert run("report", "my craft.yaml", "-q", "--with-disturbances", "-o", "a.html").returncode == 0
    first = (tmp_path / "a.html").read_text(encoding="utf-8")
    *_, command, file = (one.text for one in parsed(first).all("pre"))
    assert command == "nutdamp report 'my craft.yaml' -q --with-disturbances -o a.html"
    (tmp_path / "my craft.yaml").write_text(file + "\n")
    assert run(*shlex.split(command)[1:]).returncode == 0
    assert (tmp_path / "a.html").read_text(encoding="utf-8") == first


def test_standard_output_holds_the_page_alone(run: Run) -> None:
    done = run("report", "-", "--scheme", "four-pulse", "-o", "-", stdin=IDEAL)
    assert done.stdout.startswith("<!DOCTYPE html>")
    assert done.stdout.endswith("</html>\n")
    assert "wrote" not in done.stderr


def verdict_of(page: Path, kind: str) -> str:
    """The verdict on a page, which is of that kind: good or bad."""
    tree = parsed(page.read_text(encoding="utf-8"))
    (found,) = (one for one in tree.all("p") if one.attributes.get("class") == f"verdict {kind}")
    return found.text


@pytest.mark.usefixtures("plain_pages")
@pytest.mark.parametrize(
    ("text", "arguments", "status", "said"),
    [
        (IDEAL, ("--scheme", "four-pulse"), 3, "No recommendation: no scheme is feasible."),
        (
            IDEAL + "requirement: {momentum_shift: 0.01 deg}\n",
            ("--scheme", "one-pulse"),
            4,
            "one-pulse does not meet the requirement.",
        ),
    ],
    ids=["infeasible", "missed"],
)
def test_the_page_is_written_whatever_the_verdict(
    run: Run, tmp_path: Path, text: str, arguments: tuple[str, ...], status: int, said: str
) -> None:
    (tmp_path / "craft.yaml").write_text(text)
    done = run("report", "craft.yaml", "-o", "report.htm", *arguments)
    assert said.rstrip(".").lower() in done.stderr.lower()
    assert done.returncode == status
    assert said in verdict_of(tmp_path / "report.htm", "bad")


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("-o", "report.pdf"), 2, "--output report.pdf: a report is written as HTML"),
        (("-o", "report.md"), 2, "a browser prints that as PDF"),
        (("-o", "report"), 2, "is written as HTML"),
        (("-o", "no/report.html"), 1, "cannot write no/report.html"),
        (("missing.yaml",), 1, "cannot read missing.yaml"),
        (("--scheme", "three-pulse"), 2, "three-pulse"),
        (("--target", "10deg"), 2, "is not two angles"),
        (("--disperse", "-1"), 2, "number of cases"),
    ],
)
def test_what_cannot_be_leaves_nothing(
    run: Run, tmp_path: Path, arguments: tuple[str, ...], status: int, said: str
) -> None:
    done = run("report", *arguments)
    assert done.returncode == status
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("plain_pages")
def test_dispersions_decide_too(run: Run, tmp_path: Path) -> None:
    text = IDEAL + "requirement: {nutation: 0.2 deg}\ndispersions: {omega0: {normal: 1 deg/s}}\n"
    (tmp_path / "craft.yaml").write_text(text)
    done = run("report", "craft.yaml", "--scheme", "two-pulse", "-o", "report.html", "--disperse", "1e3")
    assert done.returncode == 4
    said = verdict_of(tmp_path / "report.html", "bad")
    verdict = re.search(r"Requirement (NOT met: [\d.]+ % of cases comply \(99.7 % required\))\.", said)
    assert verdict is not None
    report = parsed((tmp_path / "report.html").read_text(encoding="utf-8")).text
    assert report.count(verdict[1]) == 3  # the verdict, the tile, the section below


def test_what_is_not_dispersed_says_what_to_write(run: Run, tmp_path: Path) -> None:
    (tmp_path / "craft.yaml").write_text(IDEAL)
    done = run("report", "craft.yaml", "--disperse", "100")
    assert done.returncode == 2
    assert "has no dispersions" in done.stderr
    assert not (tmp_path / "report.html").exists()


def test_an_old_page_stays_where_the_new_one_cannot_be_made(run: Run, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("old")
    (tmp_path / "craft.yaml").write_text("name: X\n")
    assert run("report", "craft.yaml").returncode == 2
    assert (tmp_path / "report.html").read_text() == "old"


@pytest.mark.usefixtures("plain_pages")
@spread(
    ("words", "cases"),
    [
        (("--disperse",), "20,000"),
        (("--disperse", "-o", "page.html"), "20,000"),
        (("--disperse", "spacecraft.yaml"), "20,000"),
        (("spacecraft.yaml", "--disperse", "300"), "300"),
        (("--disperse=3e2", "spacecraft.yaml"), "300"),
        (("--disperse", "300", "spacecraft.yaml"), "300"),
    ],
    quick=1,
)
def test_the_number_of_dispersed_cases_may_be_left_out(
    run: Run, tmp_path: Path, words: tuple[str, ...], cases: str
) -> None:
    assert run("init").returncode == 0
    done = run("report", "--scheme", "two-pulse", *words, *(() if "-o" in words else ("-o", "page.html")))
    assert done.returncode == 4, done.stderr
    assert f"and in {cases} dispersed cases" in (tmp_path / "page.html").read_text("utf-8")


@pytest.mark.parametrize("number", ["0", "-3", "nan", "1.5"])
def test_a_number_that_counts_no_cases_is_refused(run: Run, number: str) -> None:
    done = run("report", "--disperse", number, "-o", "page.html")
    assert done.returncode == 2
    assert "not a number of cases" in done.stderr


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_with_a_target_the_page_says_how_far_off_it_ends(run: Run, tmp_path: Path) -> None:
    assert run("report", "--scheme", "half-cone", "--target", "10deg,45deg", "-o", "page.html").returncode == 0
    page = parsed((tmp_path / "page.html").read_text("utf-8")).text.replace("\N{NO-BREAK SPACE}", " ")
    assert "H ends attilt 10.0000 deg, azimuth 45.0000 deg" in page
    assert "error of H≤ 0.2 deg" in page
    assert "off the target" in page

"""``nutdamp report`` as a process: what it writes, and that it writes nothing where it cannot."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path

import pytest
from process import Run

from nutdamp import __version__
from nutdamp.errors import CannotWrite
from nutdamp.presentation.page import pdf

IDEAL = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"


@pytest.mark.slow
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


@pytest.mark.slow
def test_trade_may_come_without_a_number(run: Run, tmp_path: Path) -> None:
    """A file may follow it, and a number of points."""
    (tmp_path / "craft.yaml").write_text(run("init", "-").stdout)
    for given in (("--trade", "2"), ("craft.yaml", "--trade"), ("--trade", "craft.yaml")):
        assert run("report", "-q", "-o", "a.md", *given).returncode == 0
        text = (tmp_path / "a.md").read_text(encoding="utf-8")
        assert "## Time against cost" in text
        assert "| first-order least |" in text
    assert run("report", "--trade", "0").returncode == 2


@pytest.mark.slow
@pytest.mark.plans_anew
def test_what_is_repeated_gives_the_same_page(run: Run, tmp_path: Path) -> None:
    (tmp_path / "my craft.yaml").write_text(run("init", "-").stdout)
    assert run("report", "my craft.yaml", "-q", "--with-disturbances", "-o", "a.md").returncode == 0
    first = (tmp_path / "a.md").read_text(encoding="utf-8")
    command, file = re.findall(r"```(?:console|yaml)\n(.*?)\n```", first, re.DOTALL)
    assert command == "nutdamp report 'my craft.yaml' -q --with-disturbances -o a.md"
    (tmp_path / "my craft.yaml").write_text(file + "\n")
    assert run(*shlex.split(command)[1:]).returncode == 0
    assert (tmp_path / "a.md").read_text(encoding="utf-8") == first


def test_standard_output_holds_the_page_alone(run: Run) -> None:
    done = run("report", "-", "--scheme", "four-pulse", "-o", "-", stdin=IDEAL)
    assert done.stdout.startswith("<!DOCTYPE html>")
    assert done.stdout.endswith("</html>\n")
    assert "wrote" not in done.stderr


def test_markdown_needs_no_pictures(run: Run, tmp_path: Path) -> None:
    assert run("report", "-q", "-o", "report.md").returncode == 0
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    said = "Requirement met with nominal values; dispersed cases were not flown. Recommended: optimal"
    assert text.startswith(f"# Sounder-1: damping 5 deg of nutation\n\n✅ **{said}")
    assert "| **optimal** |" in text
    assert "<svg" not in text


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
    done = run("report", "craft.yaml", "-o", "report.md", *arguments)
    assert said.rstrip(".").lower() in done.stderr.lower()
    assert done.returncode == status
    verdict = (tmp_path / "report.md").read_text(encoding="utf-8").splitlines()[2]
    assert verdict.startswith("⚠️ **")
    assert said in verdict


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("-o", "report.doc"), 2, "use one of .html, .md, .pdf"),
        (("-o", "report"), 2, "use one of"),
        (("-o", "no/report.md"), 1, "cannot write no/report.md"),
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


def test_dispersions_decide_too(run: Run, tmp_path: Path) -> None:
    text = IDEAL + "requirement: {nutation: 0.2 deg}\ndispersions: {omega0: {normal: 1 deg/s}}\n"
    (tmp_path / "craft.yaml").write_text(text)
    done = run("report", "craft.yaml", "--scheme", "two-pulse", "-o", "report.md", "--disperse", "1e3")
    assert done.returncode == 4
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    verdict = re.search(
        r"Requirement (NOT met: [\d.]+ % of cases comply \(99.7 % required\))\.", report.splitlines()[2]
    )
    assert verdict is not None
    assert report.count(verdict[1]) == 3  # the verdict, the tile, the section below
    assert report.splitlines()[2].startswith("⚠️")
    assert "NOT met" in report


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


def test_without_a_browser_no_pdf(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(pdf.VARIABLE, "no-such-browser")
    done = run("report", "-o", "report.pdf")
    assert done.returncode == 1
    assert "cannot write report.pdf: a browser prints the PDF, and none is found" in done.stderr
    assert list(tmp_path.iterdir()) == []


def printer(folder: Path, script: str) -> str:
    """An executable that stands for the browser."""
    path = folder / "browser"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.skipif(os.name == "nt", reason="what stands for the browser is a shell script")
@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("echo 'no display' >&2; exit 3", "printed nothing: no display"),
        ("exit 0", "printed nothing: it said nothing"),
        ("exec sleep 30", "printed nothing: .*timed out after"),
    ],
    ids=["fails", "writes nothing", "hangs"],
)
def test_a_browser_that_prints_nothing_is_an_error(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: str, said: str
) -> None:
    monkeypatch.setenv(pdf.VARIABLE, printer(tmp_path, script))
    if "timed out" in said:
        monkeypatch.setattr(pdf, "PATIENCE", 0.1)
    with pytest.raises(CannotWrite, match=f"cannot write report.pdf: .*{said}"):
        pdf.printed("<p>", "report.pdf")


@pytest.mark.skipif(os.name == "nt", reason="what stands for the browser is a shell script")
def test_what_the_browser_prints_is_the_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    copy = "for word; do case $word in --print-to-pdf=*) out=${word#*=};; file://*) page=${word#file://};; esac; done"
    monkeypatch.setenv(pdf.VARIABLE, printer(tmp_path, f'{copy}; cp "$page" "$out"'))
    assert pdf.printed("<p>ω", "report.pdf") == "<p>ω".encode()


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("words", "cases"),
    [
        (("--disperse",), "20,000"),
        (("--disperse", "-o", "page.md"), "20,000"),
        (("--disperse", "spacecraft.yaml"), "20,000"),
        (("spacecraft.yaml", "--disperse", "300"), "300"),
        (("--disperse=3e2", "spacecraft.yaml"), "300"),
        (("--disperse", "300", "spacecraft.yaml"), "300"),
    ],
)
def test_the_number_of_dispersed_cases_may_be_left_out(
    run: Run, tmp_path: Path, words: tuple[str, ...], cases: str
) -> None:
    assert run("init").returncode == 0
    done = run("report", "--scheme", "two-pulse", *words, *(() if "-o" in words else ("-o", "page.md")))
    assert done.returncode == 4, done.stderr
    assert f"and in {cases} dispersed cases" in (tmp_path / "page.md").read_text("utf-8")


@pytest.mark.parametrize("number", ["0", "-3", "nan", "1.5"])
def test_a_number_that_counts_no_cases_is_refused(run: Run, number: str) -> None:
    done = run("report", "--disperse", number, "-o", "page.md")
    assert done.returncode == 2
    assert "not a number of cases" in done.stderr


@pytest.mark.slow
def test_with_a_target_the_page_says_how_far_off_it_ends(run: Run, tmp_path: Path) -> None:
    assert run("report", "--scheme", "half-cone", "--target", "10deg,45deg", "-o", "page.md").returncode == 0
    page = (tmp_path / "page.md").read_text("utf-8")
    assert "H ends at: **tilt 10.0000 deg, azimuth 45.0000 deg**" in page
    assert "| error of H | ≤ 0.2 deg |" in page
    assert page.count("| off the target") >= 1

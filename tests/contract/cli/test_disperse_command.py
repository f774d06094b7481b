"""``nutdamp disperse`` as a command."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cases import spread
from support.dispersed import FILE
from support.markup import parsed
from support.process import Run

from nutdamp import dispersion

pytestmark = pytest.mark.usefixtures("plans_shared")

PERCENTS = ("50", "90", "95", "99", "99.7")
COLUMNS = ("nutation_deg", "momentum_shift_deg", "axis_error_deg", "spin_change_rad_s", "propellant_kg")


@pytest.fixture
def body(tmp_path: Path) -> Path:
    path = tmp_path / "body.yaml"
    path.write_text(FILE)
    return path


def changed(body: Path, old: str, new: str) -> None:
    text = body.read_text()
    assert old in text
    body.write_text(text.replace(old, new))


def test_the_json_is_that_of_the_contract(run: Run, body: Path) -> None:
    done = run("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "5000", "--seed", "7", "--json", "-")
    assert done.returncode == 0
    data: dict[str, Any] = json.loads(done.stdout)
    assert (data["scheme"], data["samples"], data["seed"], data["redrawn"]) == ("two-pulse", 5000, 7, 0)
    for column in COLUMNS:
        assert {*PERCENTS, "max"} <= set(data["percentiles"][column])
    nutation = data["percentiles"]["nutation_deg"]
    assert sorted(nutation[percent] for percent in PERCENTS) == [nutation[percent] for percent in PERCENTS]
    requested = data["requirement"]
    assert requested["low"] < requested["met_fraction"] < requested["high"]
    assert requested["confidence"] == 0.95
    assert sum(share["analytic"] for share in data["shares"]) == pytest.approx(1.0)
    assert {share["input"] for share in data["shares"]} > {"A", "C", "omega0_1", "thrust steerable", "timing pulse 2"}
    assert all(0.0 <= share["sampled"] <= 1.0 for share in data["shares"])
    assert data["unused"] == ["position steerable"]
    assert len(data["worst"]) == 5


@pytest.mark.deep
def test_the_csv_has_every_case_and_gives_the_same_percentiles(run: Run, body: Path, tmp_path: Path) -> None:
    done = run(
        "disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "20000", "--csv", "s.csv", "--json", "s.json"
    )
    assert done.returncode == 0
    data = json.loads((tmp_path / "s.json").read_text())
    rows = list(csv.DictReader(io.StringIO((tmp_path / "s.csv").read_text(), newline="")))
    assert [row["case"] for row in rows] == [str(case) for case in range(1, 20_001)]
    for column in COLUMNS:
        values = np.array([float(row[column]) for row in rows])
        found = [data["percentiles"][column][percent] for percent in PERCENTS]
        assert found == pytest.approx(np.percentile(values, [float(percent) for percent in PERCENTS]), rel=1e-12)
    inputs = {name: np.array([float(row[name]) for row in rows]) for name in ("A_kgm2", "thrust_pulse_1_factor")}
    assert inputs["A_kgm2"].mean() == pytest.approx(120.0, rel=1e-3)
    assert inputs["A_kgm2"].std() == pytest.approx(1.2, rel=0.02)
    assert inputs["thrust_pulse_1_factor"].std() == pytest.approx(0.01, rel=0.02)
    assert {row["timing_offset_s"] for row in rows} == {"0.002"}
    good = sum(float(row["nutation_deg"]) <= 0.6 and float(row["momentum_shift_deg"]) <= 0.4 for row in rows)
    assert data["requirement"]["met_fraction"] == good / 20_000
    worst = data["worst"][0]
    assert float(rows[worst["case"] - 1]["nutation_deg"]) == pytest.approx(worst["nutation_deg"], rel=1e-12)
    assert float(rows[worst["case"] - 1]["A_kgm2"]) == pytest.approx(worst["inputs"]["A"], rel=1e-12)


def test_a_worst_case_can_be_run_again(run: Run, body: Path) -> None:
    arguments = ("disperse", "body.yaml", "--scheme", "two-pulse", "--seed", "3")
    worst = json.loads(run(*arguments, "--samples", "40000", "--json", "-").stdout)["worst"][1]
    again = json.loads(run(*arguments, "--case", str(worst["case"]), "--json", "-").stdout)
    assert again.pop("inputs") == pytest.approx(worst.pop("inputs"), rel=1e-12)
    assert {name: again[name] for name in worst} == pytest.approx(worst, rel=1e-12)
    shown = run(*arguments, "--case", str(worst["case"]))
    assert shown.returncode == 0
    assert f"case {worst['case']}" in shown.stdout
    for text in ("thrust pulse 2", "attitude y", "nominal  this case", "in sigmas"):
        assert text in shown.stdout


@pytest.mark.parametrize("columns", [80, 140])
def test_the_screen_says_what_dominates_and_what_is_unused(run: Run, body: Path, columns: int) -> None:
    done = run("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "2000", columns=columns)
    assert done.returncode == 0
    for text in ("99.7 %", "Requirement", "95 % interval", "The nutation:", "dominate", "Worst cases", "--case"):
        assert text in done.stdout
    assert "position steerable" in done.stdout
    assert "gives a pure torque" in " ".join(done.stdout.split())
    assert max(map(len, done.stdout.splitlines())) <= columns
    assert "…" not in done.stdout


def test_runs_of_one_and_two_threads_agree(run: Run, body: Path) -> None:
    arguments = ("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "40000", "--json", "-")
    one, two = (run(*arguments, "--threads", threads).stdout for threads in ("1", "2"))
    assert one == two


def test_a_requirement_that_is_missed_is_status_4(run: Run, body: Path) -> None:
    changed(body, "probability: 60 %", "probability: 99.99 %")
    done = run("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "2000")
    assert done.returncode == 4
    assert "NOT met" in done.stdout
    changed(body, "requirement:", "# requirement:")
    done = run("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "2000", "--json", "r.json")
    assert done.returncode == 0
    assert "no requirement" in done.stdout
    assert json.loads((body.parent / "r.json").read_text())["requirement"] is None


def test_few_good_cases_show_little(run: Run, body: Path) -> None:
    changed(body, "nutation: 0.6 deg, momentum_shift: 0.4 deg, probability: 60 %", "nutation: 9 deg")
    done = run("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "50")
    assert done.returncode == 0
    assert "met: 100.0 % of cases comply (99.7 % required)" in " ".join(done.stdout.split())
    assert "It takes at least 1,228" in " ".join(done.stdout.split())


def test_a_schedule_file_is_dispersed(run: Run, body: Path) -> None:
    assert run("plan", "body.yaml", "--scheme", "one-pulse", "--csv", "p.csv").returncode in (0, 4)
    done = run("disperse", "body.yaml", "--schedule", "p.csv", "--samples", "100", "--json", "-")
    assert json.loads(done.stdout)["scheme"] == "p.csv"


def test_without_a_scheme_the_recommended_one_is_dispersed(run: Run, body: Path) -> None:
    planned = json.loads(run("plan", "body.yaml", "--json", "-").stdout)["recommended"]
    assert json.loads(run("disperse", "body.yaml", "--samples", "9", "--json", "-").stdout)["scheme"] == planned


def test_a_recommended_plan_that_does_not_damp_is_flown_with_a_warning(run: Run, body: Path) -> None:
    changed(body, "requirement:", "# requirement:")
    changed(body, "steerable: {torque: 60 N m,", "limits: {horizon: 4 s}\nsteerable: {torque: 1 N m,")
    changed(body, "limits: {earliest: 1 s}\n", "")
    done = run("disperse", "body.yaml", "--samples", "9")
    assert "schemes compared damps the nutation. " in done.stderr
    assert "warning" not in run("disperse", "body.yaml", "--samples", "9", "--quiet").stderr


@pytest.mark.deep
@spread("ending", ["png", "svg"], quick=1)
def test_pictures(run: Run, body: Path, tmp_path: Path, ending: str) -> None:
    pytest.importorskip("matplotlib")
    done = run("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "1000", "--plot", f"h.{ending}")
    assert done.returncode == 0
    start = (tmp_path / f"h.{ending}").read_bytes()[:8]
    assert start.startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[ending])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--samples", "0"), "0 is not a number of cases"),
        (("--samples", "-5"), "-5 is not a number of cases"),
        (("--samples", "1.5"), "1.5 is not a number of cases"),
        (("--samples", "many"), "many is not a number of cases"),
        (("--case", "0"), "0 is not a number of cases"),
        (("--threads", "0"), "--threads"),
        (("--seed", "-1"), "--seed"),
        (("--scheme", "two-pulse", "--schedule", "x.csv"), "one of --scheme, --schedule and --blocks"),
        (("--case", "3", "--csv", "x.csv"), "--case shows a single case"),
        (("--resume", "x.npz"), "No such option"),
        (("--flown",), "No such option"),
        (("--impulses",), "No such option"),
        (("--csv", "-", "--json", "-"), "both go to standard output"),
        (("--samples", "10", "--plot", "x.jpg"), "the ending says the format"),
    ],
)
def test_broken_command_lines(run: Run, body: Path, arguments: tuple[str, ...], said: str) -> None:
    done = run("disperse", "body.yaml", *arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert not done.stdout
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in body.parent.iterdir()) == ["body.yaml"]


def test_a_file_without_dispersions_is_reported_what_to_add(run: Run, body: Path) -> None:
    body.write_text(FILE[: FILE.index("dispersions:")])
    done = run("disperse", "body.yaml")
    assert done.returncode == 2
    assert "has no dispersions" in done.stderr
    snippet = done.stderr[done.stderr.index("dispersions:\n") :]
    body.write_text(body.read_text() + snippet)
    assert run("disperse", "body.yaml", "--samples", "10", "-q").returncode in (0, 4)


def test_dispersions_that_are_impossible_are_refused(run: Run, body: Path) -> None:
    changed(body, "C: {normal: 1 %}", "C: {bias: 250 %}")
    done = run("disperse", "body.yaml", "--samples", "10")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_reported(run: Run, body: Path) -> None:
    done = run("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "20000", "--csv", "/dev/full")
    assert done.returncode == 1
    assert "cannot write /dev/full: No space left" in done.stderr
    assert not done.stdout


def test_more_rows_than_the_disk_holds_are_refused_at_once(run: Run, body: Path) -> None:
    done = run("disperse", "body.yaml", "--scheme", "two-pulse", "--samples", "1e12", "--csv", "big.csv")
    assert done.returncode == 1
    assert "cannot write big.csv" in done.stderr
    assert "GB are free" in done.stderr
    assert [path.name for path in body.parent.iterdir()] == ["body.yaml"]


def test_the_default_number_of_cases_is_that_of_the_other_commands(run: Run, body: Path) -> None:
    from nutdamp.cli import disperse

    assert disperse.SAMPLES == dispersion.SAMPLES
    data = json.loads(run("disperse", "body.yaml", "--scheme", "two-pulse", "--json", "-").stdout)
    assert (data["samples"], data["seed"]) == (20_000, 1)


@pytest.mark.weekly
def test_every_command_gives_the_same_share_for_the_same_plan(run: Run, tmp_path: Path) -> None:
    """`disperse`, `plan --robust` and `report` of the built-in example, 20,000 cases of seed 1."""
    sentence = r"((?:NOT )?met: [\d.]+ % of cases comply \([\d.]+ % required\))"

    def verdict(text: str) -> str:
        found = re.search(sentence, " ".join(text.split()))
        assert found is not None, text
        return found[1]

    done = run("plan", "--robust", "--scheme", "two-pulse", "--json", "robust.json")
    assert done.returncode == 4
    robust = json.loads((tmp_path / "robust.json").read_text())["robust"]
    (planned,) = [one for one in robust["candidates"] if one["variant"] == "as planned"]
    assert planned["met_fraction"] == robust["recommended"]["met_fraction"]
    dispersed_ = run("disperse", "--scheme", "two-pulse", "--json", "s.json")
    assert json.loads((tmp_path / "s.json").read_text())["requirement"]["met_fraction"] == planned["met_fraction"]
    assert run("report", "--scheme", "two-pulse", "--disperse", "20000", "-o", "r.html").returncode == 4
    report = parsed((tmp_path / "r.html").read_text(encoding="utf-8")).text
    assert verdict(done.stdout) == verdict(dispersed_.stdout) == verdict(report)
    assert set(re.findall(sentence, report)) == {verdict(report)}
    assert verdict(report).startswith(f"NOT met: {100 * planned['met_fraction']:.1f} % of cases comply")


def test_one_case_and_all_cases_show_the_same_nominal_one(run: Run) -> None:
    many = run("disperse", "--scheme", "four-pulse", "--samples", "100").stdout
    one = run("disperse", "--scheme", "four-pulse", "--case", "7").stdout
    rows = {"many": many, "one": one}
    found = {name: re.search(r"^shift of H, deg +(.*)$", text, re.MULTILINE) for name, text in rows.items()}
    assert found["many"] is not None
    assert found["one"] is not None
    nominal = found["many"][1].split()[0]
    assert nominal == found["one"][1].split()[0] == "0.1684"


@pytest.mark.deep
def test_it_says_where_the_nominal_case_ends_and_where_it_should(run: Run, tmp_path: Path) -> None:
    goal = ("--scheme", "half-cone", "--target", "10deg,45deg")
    done = run("disperse", *goal, "--samples", "200", "--json", "d.json")
    data = json.loads((tmp_path / "d.json").read_text())
    simulated = json.loads(run("simulate", *goal, "--json", "-").stdout)
    for name in ("axis", "momentum"):
        assert data["final"][name] == pytest.approx(simulated["final"][name], abs=1e-6)
    assert data["target"]["axis"] == pytest.approx({"tilt_deg": 10.0, "azimuth_deg": 45.0})
    assert re.search(r"^target +tilt 10\.0000 deg, azimuth 45\.0000 deg; H ends .+ deg off$", done.stdout, re.MULTILINE)
    assert re.search(r"^spin axis ends at +tilt 1[01]\.[0-9]{4} deg", done.stdout, re.MULTILINE)
    words = " ".join(done.stdout.split())
    assert "alone on the nutation and on the error of H" in words
    assert "on the shift of H" not in words


def spin_rows(screen: str) -> dict[str, list[float]]:
    """Numbers of the rows of spin changes, mrad/s, by what stands before them."""
    rows = re.findall(r"^spin change ?([≤≥]?), mrad/s +(.+)$", screen, re.MULTILINE)
    return {sign: [float(number) for number in numbers.split()] for sign, numbers in rows}


def test_spin_changes_have_both_tails_where_they_have_both_signs(run: Run, tmp_path: Path) -> None:
    """So many of the cases do not exceed a value of the one row, and stay above that of the other."""
    done = run("disperse", "--scheme", "two-pulse", "--samples", "400", "--quiet", "--csv", "s.csv", columns=140)
    with (tmp_path / "s.csv").open(encoding="utf-8") as file:
        changes = 1e3 * np.array([float(row["spin_change_rad_s"]) for row in csv.DictReader(file)])
    assert changes.min() < 0.0 < changes.max()
    rows, shares = spin_rows(done.stdout), np.array([float(percent) / 100.0 for percent in PERCENTS])
    assert rows["≤"][1:] == pytest.approx([*np.quantile(changes, shares), changes.max()], abs=1e-3)
    assert rows["≥"][1:] == pytest.approx([*np.quantile(changes, 1.0 - shares), changes.min()], abs=1e-3)


def test_spin_changes_of_one_sign_have_one_row(run: Run) -> None:
    """The upper stage only loses spin: what counts is how much, so the row falls to the largest loss."""
    assert run("init", "--from", "upper-stage", "stage.yaml").returncode == 0
    done = run("disperse", "stage.yaml", "--scheme", "one-pulse", "--samples", "300", "--quiet", columns=140)
    (sign,), (numbers,) = spin_rows(done.stdout).keys(), spin_rows(done.stdout).values()
    assert sign == "≥"
    assert numbers[1:] == sorted(numbers[1:], reverse=True)
    assert numbers[-1] < 0.0

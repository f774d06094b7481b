"""Plans, flights and studies of the library: arrays in the axes of the file, and what the commands write."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import sys
import types
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import places
from support.golden import refused
from support.markup import parsed
from support.process import Run
from support.tilted import KEYS, TILTED

import nutdamp
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.figures import style
from nutdamp.files import schedules, tabular
from nutdamp.page import report

pytestmark = pytest.mark.usefixtures("plans_shared")

CRAFT = nutdamp.example()


def written(data: object) -> object:
    """As JSON has it."""
    return json.loads(json.dumps(data, allow_nan=False))


def test_files_are_those_of_the_command_line(run: Run, tmp_path: Path) -> None:
    run("plan", "--nominal", "--scheme", "two-pulse", "--csv", "pulses.csv", "--json", "plan.json")
    run("simulate", "--scheme", "two-pulse", "--flown", "--csv", "flown.csv")
    run("simulate", "--scheme", "two-pulse", "--csv", "impulses.csv")
    plan = nutdamp.plan(CRAFT, "two-pulse")
    made = {"pulses": plan, "flown": plan.fly(), "impulses": plan.fly(by_impulses=True)}
    for name, each in made.items():
        each.to_csv(tmp_path / "own.csv")
        assert (tmp_path / "own.csv").read_bytes() == (tmp_path / f"{name}.csv").read_bytes()
    assert nutdamp.compare(CRAFT, ["two-pulse"], samples=0).to_dict() == json.loads(
        (tmp_path / "plan.json").read_text()
    )


@pytest.mark.deep
def test_a_comparison_has_the_numbers_of_the_command(run: Run) -> None:
    """With dispersed cases, too."""
    schemes = ("two-pulse", "four-pulse")
    shown = json.loads(run("plan", *(part for each in schemes for part in ("--scheme", each)), "--json", "-").stdout)
    assert written(nutdamp.compare(CRAFT, schemes).to_dict()) == shown
    assert [plan["meets_requirement"] for plan in shown["plans"]] == [True, False]
    assert shown["decision"]["cases"]["samples"] == 20_000


def test_arrays_and_data_frames_have_the_columns_of_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = nutdamp.plan(nutdamp.read(TILTED), "two-pulse")
    pandas = types.ModuleType("pandas")
    pandas.DataFrame = dict  # type: ignore[attr-defined]
    for made, header in ((plan, schedules.PULSES_HEADER), (plan.fly(samples=50), tabular.HEADER)):
        array = made.to_numpy()
        assert array.dtype.names == header
        made.to_csv(tmp_path / "rows.csv")
        rows = list(csv.reader(io.StringIO((tmp_path / "rows.csv").read_text())))[1:]
        for mine, row in zip(array.tolist(), rows, strict=True):
            assert [str(cell) for cell in mine] == [cell or "nan" for cell in row]
        monkeypatch.setitem(sys.modules, "pandas", pandas)
        frame = made.to_pandas()
        assert tuple(frame) == header
        assert all(np.array_equal(frame[name], array[name]) for name in header)
        monkeypatch.setitem(sys.modules, "pandas", None)
        with refused(nutdamp.NutdampError, "library.no-pandas"):
            made.to_pandas()
        with pytest.raises(ImportError):
            made.to_pandas()


def test_the_track_is_in_the_axes_of_the_file() -> None:
    craft, tensor = nutdamp.read(TILTED), np.array([[120.0, 3, 6], [3, 118, -4], [6, -4, 80]])
    made = nutdamp.plan(craft, "none").fly(until=5.0, samples=200)
    track = made.track
    assert track.rates[0] == pytest.approx([0.2, 0.1, 3.0], abs=1e-14)
    assert craft.rates == pytest.approx([0.2, 0.1, 3.0], abs=1e-14)
    # H = R I ω stays where it is, with the tensor as the file has it.
    turn = Rotation.from_quat(np.roll(track.quaternion, -1, axis=1)).as_matrix()
    momentum = np.einsum("nij,nj->ni", turn, track.rates @ tensor)
    assert momentum == pytest.approx(np.broadcast_to(momentum[0], momentum.shape), abs=1e-9)
    assert momentum == pytest.approx(track.momentum, abs=1e-9)
    assert made.to_numpy()["omega_1_rad_s"] == pytest.approx(track.rates[:, 0], abs=0.0)


def test_a_written_schedule_is_read_as_a_plan(tmp_path: Path) -> None:
    plan = nutdamp.plan(CRAFT, "four-pulse")
    plan.to_csv(tmp_path / "pulses.csv")
    again = nutdamp.load_schedule(tmp_path / "pulses.csv", CRAFT)
    assert again.fly().residual == plan.fly().residual
    assert again.propellant == pytest.approx(plan.propellant, rel=1e-12)
    (tmp_path / "edited.csv").write_text((tmp_path / "pulses.csv").read_text().replace("-M1", "+M9"))
    with pytest.warns(UserWarning, match=r"\+M9"):
        nutdamp.load_schedule(tmp_path / "edited.csv", CRAFT)


def test_the_recommended_plan_is_one_of_those_compared() -> None:
    compared = nutdamp.compare(CRAFT, samples=0)
    assert [plan.scheme for plan in compared] == ["one-pulse", "two-pulse", "four-pulse", "optimal"]
    assert compared.recommended is not None
    chosen = compared[compared.recommended.scheme]
    assert chosen.meets_requirement
    assert chosen.flown == compared.recommended.flown
    assert chosen.total_impulse >= CRAFT.least_impulse * (1 - 1e-12)
    with pytest.raises(KeyError):
        compared["half-cone"]


def test_so_many_dispersed_cases_as_are_requested_decide() -> None:
    """Those of `disperse`; with the plans that it is not about so few of them as it takes."""
    nominal, compared = (nutdamp.compare(CRAFT, ["four-pulse", "two-pulse"], samples=count) for count in (0, 2_100))
    assert nominal.recommended is nominal["four-pulse"]
    assert (nominal.flown, nominal.cases, nominal.verdict.cases, nominal.verdict.results) == (None, {}, None, None)
    assert [nominal.verdicts[plan].met for plan in nominal] == [True, True]
    chosen, other = compared["two-pulse"], compared["four-pulse"]
    assert compared.recommended is chosen
    assert [plan.meets_requirement for plan in compared] == [True, True]
    assert [compared.verdicts[plan].status.value for plan in (chosen, other)] == ["fly", "not-enough"]
    cases, few = compared.cases[chosen], compared.cases[other]
    assert (cases.samples, cases.final, cases.enough) == (2_100, True, True)
    assert cases.complying == nutdamp.disperse(chosen, 2_100).met_fraction == 1.0
    assert 0.997 < cases.low < cases.high == 1.0
    assert (few.samples, few.final, few.enough) == (2_048, False, False)
    assert few.high < 0.997


def test_dictionaries_hold_no_number_that_json_has_not() -> None:
    """A sphere has no nutation period in the body, and an ideal torquer no torque and no propellant."""
    ball = nutdamp.read("name: Ball\ninertia: {A: 100, C: 100}\nstate: {spin: 3, nutation: 5 deg}\n")
    compared = nutdamp.compare(ball)
    assert ball.to_dict()["body_nutation_period_s"] is None
    for each in (ball, compared, *compared):
        written(each.to_dict())


@pytest.fixture
def dispersed(tmp_path: Path) -> Path:
    shutil.copy(places.CONFIGS / "single-thruster.yaml", tmp_path / "spacecraft.yaml")
    return tmp_path


@pytest.mark.weekly
def test_studies_have_the_numbers_of_the_commands(run: Run, dispersed: Path) -> None:
    craft = nutdamp.load(dispersed / "spacecraft.yaml")
    chosen = nutdamp.compare(craft).recommended
    assert chosen is not None
    chosen.to_csv(dispersed / "pulses.csv")
    held = nutdamp.load_schedule(dispersed / "pulses.csv", craft)
    for command, made in (
        (("disperse", "--samples", "200", "--seed", "3"), nutdamp.disperse(chosen, 200, seed=3).to_dict()),
        (("verify",), nutdamp.verify(chosen).to_dict()),
        (("verify", "--schedule", "pulses.csv"), {**nutdamp.verify(held).to_dict(), "scheme": "pulses.csv"}),
    ):
        screen = run(*command, "--json", "own.json")
        assert screen.returncode in (0, 4), screen.stderr
        assert json.loads((dispersed / "own.json").read_text()) == written(made)


def test_a_trade_has_the_numbers_of_the_command(run: Run) -> None:
    changed = {"limits": {"horizon": "8 s"}}
    options = ("--points", "2", "--allow", "0", "--least", "impulse", "--set", "limits.horizon=8 s", "--json", "-")
    found = nutdamp.trade(CRAFT.with_(**changed), points=2, allow=(0.0,), least="impulse")
    assert written(found.to_dict()) == json.loads(run("trade", *options).stdout)
    assert len(found.plans) == len(found.fronts[0].points) > 0
    assert all(plan.feasible for plan in found.plans)


def test_an_export_is_that_of_the_command(run: Run, tmp_path: Path) -> None:
    attitude = {"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}
    timed = "attitude={quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}"
    plan = nutdamp.plan(CRAFT.with_(attitude=attitude), "two-pulse")
    for form, name in (("stk", "x.a"), ("basilisk", "x.py"), ("json", "x.json"), ("aem", "x.xml"), ("apm", "x.apm")):
        run("export", "--format", form, "--scheme", "two-pulse", "--set", timed, "-o", f"command-{name}")
        nutdamp.export(plan, form, tmp_path / name)
        texts = [(tmp_path / file).read_text() for file in (name, f"command-{name}")]
        mine, its = (re.sub(r"(CREATION_DATE|MESSAGE_ID)( *= *|>)[^<\n]*", r"\1", text) for text in texts)
        assert mine == its


@pytest.mark.weekly
def test_a_report_is_that_of_the_command(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.yaml").write_text(TILTED)
    chosen = ("--scheme", "two-pulse", "--set", "limits.horizon=100 s")
    assert run("report", "own.yaml", *chosen, "-o", "command.html").returncode == 0
    craft = nutdamp.load("own.yaml", set={"limits.horizon": "100 s"})
    made = nutdamp.report(craft, tmp_path / "own.html", ["two-pulse"])
    texts = [(tmp_path / name).read_text() for name in ("own.html", "command.html")]
    assert (made.content, made.good) == (texts[0], True)
    assert made.verdict.status.value == "fly"
    assert re.match(r"FLY two-pulse: .*\. Met with nominal values\.", made.summary)
    assert made.comparison["two-pulse"].feasible
    mine, its = (re.sub(r"<pre>nutdamp.*report.*</pre>", "", text) for text in texts)
    assert mine == its
    again = nutdamp.report({**KEYS, "limits": {"horizon": "100 s"}}, tmp_path / "dict.html", ["two-pulse"])
    assert again.summary == made.summary
    assert str(again.content).startswith("<!DOCTYPE html>")


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_a_report_of_replaced_fields_names_no_file(tmp_path: Path) -> None:
    nutdamp.report(CRAFT.replace(name="Other"), tmp_path / "own.html", ["two-pulse"])
    text = (tmp_path / "own.html").read_text()
    assert "<h1>Other · damp" in text
    assert not parsed(text).all("a")
    assert f"nutdamp.report(spacecraft, {str(tmp_path / 'own.html')!r}, ['two-pulse'])" in parsed(text).text


@pytest.mark.weekly
def test_a_report_disperses_as_disperse_does(dispersed: Path) -> None:
    craft, options = nutdamp.load(dispersed / "spacecraft.yaml"), nutdamp.Options(on_time=0.2)
    made = nutdamp.report(craft, dispersed / "own.html", options=options, disperse=200)
    text = (dispersed / "own.html").read_text()
    assert ", options=nutdamp.Options(on_time=0.2), disperse=200)" in text
    assert made.comparison.recommended is not None
    assert made.verdict.cases is not None
    assert made.verdict.cases.complying == nutdamp.disperse(made.comparison.recommended, 200).met_fraction
    assert "cases: 200, seed 1" in text


@pytest.mark.deep
def test_flights_comparisons_and_plans_draw_themselves() -> None:
    compared = nutdamp.compare(CRAFT, ["two-pulse", "four-pulse"], samples=500)
    plan = compared["two-pulse"]
    assert [len(plan.fly().figure(name).axes) for name in ("motion", "overview")] == [2, 5]
    assert len(plan.figure("motion").axes) >= 2
    assert compared.recommended is not None
    assert compared.recommended.scheme in compared.figure("motion").get_suptitle()
    for name in ("history", "schemes"):
        with refused(BadRequest, f"library.no-figure-{name}"):
            compared.figure(name)
    with refused(Infeasible, "library.no-figure-infeasible"):
        nutdamp.plan(CRAFT.with_(limits={"horizon": "1 ms"}), "two-pulse").figure()


@pytest.mark.deep
def test_studies_draw_themselves_and_write_their_rows(tmp_path: Path) -> None:
    stage, plan = nutdamp.example("upper-stage"), nutdamp.plan(CRAFT, "two-pulse")
    budget, simulated = nutdamp.budget(stage), nutdamp.simulate(plan, 20.0, samples=50)
    for result in (budget, simulated, nutdamp.loop(stage, 60.0), nutdamp.disperse(plan, 50)):
        assert result.figure().axes
    for rows in (budget, simulated):
        rows.to_csv(tmp_path / "rows.csv")
        assert (tmp_path / "rows.csv").read_text().count("\n") > 1
    assert len(simulated.to_numpy()) == (tmp_path / "rows.csv").read_text().count("\n") - 1


class Tags(HTMLParser):
    """Those that are open, and all that were seen."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.deep
def test_notebooks_show_small_tables() -> None:
    craft = nutdamp.read(TILTED.replace("Tilted", "'<b>&\"'"))
    compared = nutdamp.compare(craft)
    plan = compared["two-pulse"]
    for shown in (craft, compared, plan, plan.fly(), nutdamp.plan(craft, "four-pulse")):
        tags, text = Tags(), shown._repr_html_()
        assert text is not None
        tags.feed(text)
        assert tags.open == []
        assert "table" in tags.seen or "infeasible" in text
        assert ("svg" in tags.seen) == (shown is not craft and "infeasible" not in text)  # the motion beside the table
        assert "b" not in tags.seen
        assert repr(shown).startswith(f"<{type(shown).__name__}")


def test_notebooks_show_less_without_matplotlib_and_jinja(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(style, "find_spec", lambda _: None)
    text = nutdamp.plan(CRAFT, "two-pulse")._repr_html_()
    assert text is not None
    assert ("<table" in text, "<svg" in text) == (True, False)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    report._templates.cache_clear()
    assert CRAFT._repr_html_() is None

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
from support.markup import parsed
from support.process import Run
from support.tilted import KEYS, TILTED

import nutdamp
from nutdamp.files import pulses_csv, track_csv
from nutdamp.presentation.figures import style
from nutdamp.presentation.page import html

pytestmark = pytest.mark.usefixtures("plans_shared")


@pytest.fixture
def craft() -> nutdamp.Spacecraft:
    return nutdamp.example()


def test_files_are_those_of_the_command_line(craft: nutdamp.Spacecraft, run: Run, tmp_path: Path) -> None:
    run("plan", "--scheme", "two-pulse", "--csv", "pulses.csv", "--json", "plan.json")
    run("simulate", "--scheme", "two-pulse", "--flown", "--csv", "flown.csv")
    run("simulate", "--scheme", "two-pulse", "--csv", "impulses.csv")
    plan = nutdamp.plan(craft, "two-pulse")
    plan.to_csv(tmp_path / "own.csv")
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "pulses.csv").read_bytes()
    for name, by_impulses in (("flown.csv", False), ("impulses.csv", True)):
        plan.fly(by_impulses=by_impulses).to_csv(tmp_path / "own.csv")
        assert (tmp_path / "own.csv").read_bytes() == (tmp_path / name).read_bytes()
    compared = nutdamp.compare(craft, ["two-pulse"])
    assert compared.to_dict() == json.loads((tmp_path / "plan.json").read_text())


def test_arrays_have_the_columns_of_the_files(tmp_path: Path) -> None:
    plan = nutdamp.plan(nutdamp.read(TILTED), "two-pulse")
    flight = plan.fly(samples=50)
    for made, header, write in (
        (plan.to_numpy(), pulses_csv.HEADER, plan.to_csv),
        (flight.to_numpy(), track_csv.HEADER, flight.to_csv),
    ):
        assert made.dtype.names == header
        write(tmp_path / "rows.csv")
        rows = list(csv.reader(io.StringIO((tmp_path / "rows.csv").read_text())))[1:]
        assert len(rows) == len(made)
        for mine, row in zip(made.tolist(), rows, strict=True):
            assert [str(cell) for cell in mine] == [cell or "nan" for cell in row]


def test_the_track_is_in_the_axes_of_the_file() -> None:
    craft = nutdamp.read(TILTED)
    tensor = np.array([[120.0, 3, 6], [3, 118, -4], [6, -4, 80]])
    flight = nutdamp.plan(craft, "none").fly(until=5.0, samples=200)
    track = flight.track
    assert track.rates[0] == pytest.approx([0.2, 0.1, 3.0], abs=1e-14)
    assert craft.rates == pytest.approx([0.2, 0.1, 3.0], abs=1e-14)
    # H = R I ω stays where it is, with the tensor as the file has it.
    turn = Rotation.from_quat(np.roll(track.quaternion, -1, axis=1)).as_matrix()
    momentum = np.einsum("nij,nj->ni", turn, track.rates @ tensor)
    assert momentum == pytest.approx(np.broadcast_to(momentum[0], momentum.shape), abs=1e-9)
    assert momentum == pytest.approx(track.momentum, abs=1e-9)
    assert flight.to_numpy()["omega_1_rad_s"] == pytest.approx(track.rates[:, 0], abs=0.0)


def test_a_flight_draws_itself(craft: nutdamp.Spacecraft) -> None:
    flight = nutdamp.plan(craft, "two-pulse").fly()
    assert len(flight.figure("motion").axes) == 2
    assert len(flight.figure("timeline").axes) == 1


def test_a_written_schedule_is_read_as_a_plan(craft: nutdamp.Spacecraft, tmp_path: Path) -> None:
    plan = nutdamp.plan(craft, "four-pulse")
    plan.to_csv(tmp_path / "pulses.csv")
    again = nutdamp.load_schedule(tmp_path / "pulses.csv", craft)
    assert again.fly().residual == plan.fly().residual
    assert again.propellant == pytest.approx(plan.propellant, rel=1e-12)
    text = (tmp_path / "pulses.csv").read_text().replace("-M1", "+M9")
    (tmp_path / "edited.csv").write_text(text)
    with pytest.warns(UserWarning, match=r"channel '\+M9' is not in the spacecraft file"):
        nutdamp.load_schedule(tmp_path / "edited.csv", craft)


def test_the_recommended_plan_is_one_of_those_compared(craft: nutdamp.Spacecraft) -> None:
    compared = nutdamp.compare(craft)
    assert [plan.scheme for plan in compared] == ["one-pulse", "two-pulse", "four-pulse", "optimal"]
    assert compared.recommended is not None
    chosen = compared[compared.recommended.scheme]
    assert chosen.meets_requirement
    assert chosen.flown == compared.recommended.flown
    assert chosen.total_impulse >= craft.least_impulse * (1 - 1e-12)
    with pytest.raises(KeyError):
        compared["half-cone"]


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
        done = run(*command, "--json", "own.json")
        assert done.returncode in (0, 4), done.stderr
        assert json.loads((dispersed / "own.json").read_text()) == json.loads(json.dumps(made, allow_nan=False))


def test_a_trade_has_the_numbers_of_the_command(run: Run, tmp_path: Path, craft: nutdamp.Spacecraft) -> None:
    done = run("trade", "--points", "2", "--allow", "0", "--least", "impulse", "--json", "trade.json")
    assert done.returncode == 0, done.stderr
    found = nutdamp.trade(craft, points=2, allow=(0.0,), least="impulse")
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False)) == json.loads((tmp_path / "trade.json").read_text())
    assert len(found.plans) == len(found.fronts[0].points) > 0
    assert all(one.feasible for one in found.plans)


def test_an_export_is_that_of_the_command(run: Run, tmp_path: Path) -> None:
    timed = ("--set", "attitude={quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}")
    craft = nutdamp.example().with_(
        attitude={"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}
    )
    plan = nutdamp.plan(craft, "two-pulse")
    for form, name in (("stk", "x.a"), ("basilisk", "x.py"), ("json", "x.json"), ("aem", "x.xml"), ("apm", "x.apm")):
        run("export", "--format", form, "--scheme", "two-pulse", *timed, "-o", f"command-{name}")
        nutdamp.export(plan, form, tmp_path / name)
        texts = [(tmp_path / one).read_text() for one in (name, f"command-{name}")]
        mine, its = (re.sub(r"(CREATION_DATE|MESSAGE_ID)( *= *|>)[^<\n]*", r"\1", text) for text in texts)
        assert mine == its


@pytest.mark.weekly
def test_a_report_is_that_of_the_command(run: Run, tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text(TILTED)
    chosen = ("--scheme", "two-pulse", "--set", "limits.horizon=100 s")
    assert run("report", "own.yaml", *chosen, "-o", "command.html").returncode == 0
    craft = nutdamp.load(tmp_path / "own.yaml", set={"limits.horizon": "100 s"})
    made = nutdamp.report(craft, tmp_path / "own.html", ["two-pulse"])
    mine, its = ((tmp_path / name).read_text() for name in ("own.html", "command.html"))
    assert made.content == mine
    assert made.good
    assert made.verdict.startswith("Requirement met with nominal values. Recommended: two-pulse")
    assert made.comparison["two-pulse"].feasible
    mine, its = (re.sub(r"<pre>nutdamp.*report.*</pre>|Input file [^\s<\"]*", "", text) for text in (mine, its))
    assert mine == its
    again = nutdamp.report({**KEYS, "limits": {"horizon": "100 s"}}, tmp_path / "dict.html", ["two-pulse"])
    assert again.verdict == made.verdict
    assert str(again.content).startswith("<!DOCTYPE html>")


@pytest.mark.usefixtures("plain_pages")
def test_a_report_of_replaced_fields_names_no_file(craft: nutdamp.Spacecraft, tmp_path: Path) -> None:
    nutdamp.report(craft.replace(name="Other"), tmp_path / "own.html", ["two-pulse"])
    text = (tmp_path / "own.html").read_text()
    assert "<h1>Other: damping" in text
    assert "Input file" not in text
    assert f"nutdamp.report(spacecraft, {str(tmp_path / 'own.html')!r}, ['two-pulse'])" in parsed(text).text


@pytest.mark.weekly
def test_a_report_disperses_as_disperse_does(dispersed: Path) -> None:
    craft = nutdamp.load(dispersed / "spacecraft.yaml")
    options = nutdamp.Options(on_time=0.2)
    made = nutdamp.report(craft, dispersed / "own.html", options=options, disperse=200, seed=3)
    called = ", options=nutdamp.Options(on_time=0.2), disperse=200, seed=3)"
    assert called in (dispersed / "own.html").read_text()
    assert made.dispersed is not None
    assert made.comparison.recommended is not None
    assert made.dispersed.met_fraction == nutdamp.disperse(made.comparison.recommended, 200, seed=3).met_fraction
    assert made.verdict.startswith(f"Requirement {'met' if made.good else 'NOT met'}: ")
    assert "and in 200 dispersed cases" in (dispersed / "own.html").read_text()


def test_tables_become_data_frames(craft: nutdamp.Spacecraft, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = nutdamp.plan(craft, "two-pulse")
    stand_in = types.ModuleType("pandas")
    stand_in.DataFrame = dict  # type: ignore[attr-defined]
    for made in (plan, plan.fly(samples=20)):
        monkeypatch.setitem(sys.modules, "pandas", stand_in)
        frame, rows = made.to_pandas(), made.to_numpy()
        assert tuple(frame) == rows.dtype.names
        for name in rows.dtype.names:
            assert np.array_equal(frame[name], rows[name])
        monkeypatch.setitem(sys.modules, "pandas", None)
        with pytest.raises(nutdamp.NutdampError, match="needs pandas: pip install pandas"):
            made.to_pandas()


class _Tags(HTMLParser):
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
        tags = _Tags()
        text = shown._repr_html_()
        assert text is not None
        tags.feed(text)
        assert tags.open == []
        assert "table" in tags.seen or not plan.feasible or "infeasible" in text
        assert ("svg" in tags.seen) == (shown is not craft and "infeasible" not in text)  # the motion beside the table
        assert "b" not in tags.seen
        assert repr(shown).startswith(f"<{type(shown).__name__}")


@pytest.mark.deep
def test_comparisons_and_plans_draw_themselves(craft: nutdamp.Spacecraft) -> None:
    compared = nutdamp.compare(craft, ["two-pulse", "four-pulse"])
    for figure in (compared.figure(), compared.figure("schemes")):
        labels = [text.get_text() for axes in figure.axes for text in axes.get_yticklabels()]
        assert {"two-pulse", "four-pulse"} <= set(labels)
    assert len(compared["two-pulse"].figure("motion").axes) >= 2
    for name in ("motion", "nothing"):
        with pytest.raises(nutdamp.NutdampError, match=f"there is no figure '{name}'"):
            compared.figure(name)
    with pytest.raises(nutdamp.NutdampError, match="infeasible"):
        nutdamp.plan(craft.with_(limits={"horizon": "1 ms"}), "two-pulse").figure()


def test_notebooks_show_tables_alone_without_matplotlib(
    craft: nutdamp.Spacecraft, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = nutdamp.plan(craft, "two-pulse")
    monkeypatch.setattr(style, "find_spec", lambda _: None)
    text = plan._repr_html_()
    assert text is not None
    assert "<table" in text
    assert "<svg" not in text


def test_notebooks_show_a_line_without_jinja(craft: nutdamp.Spacecraft, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    html._templates.cache_clear()
    assert craft._repr_html_() is None


def test_dictionaries_hold_no_number_that_json_has_not() -> None:
    """A sphere has no nutation period in the body, and an ideal torquer no torque and no propellant."""
    ball = nutdamp.read("name: Ball\ninertia: {A: 100, C: 100}\nstate: {spin: 3, nutation: 5 deg}\n")
    compared = nutdamp.compare(ball)
    assert ball.to_dict()["body_nutation_period_s"] is None
    for one in (ball, compared, *compared):
        json.dumps(one.to_dict(), allow_nan=False)


def test_the_examples_that_ship_are_loaded_by_name() -> None:
    assert nutdamp.example("ace").name == "ACE"
    with pytest.raises(nutdamp.NutdampError, match="lunar-prospector"):
        nutdamp.example("lunar-prospecter")

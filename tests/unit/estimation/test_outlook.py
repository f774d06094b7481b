"""What a fit gives to people and programs: its file, its JSON, its screen, and whether more telemetry would pay."""

from __future__ import annotations

import io
import math
import re
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from support.builders import noted
from support.golden import check_text, refused
from support.synthetic import motion

import nutdamp
from nutdamp.api import fit
from nutdamp.errors import BadRequest
from nutdamp.estimation import forecast
from nutdamp.estimation.forecast import Fitted, Outlook, Prospect
from nutdamp.estimation.results import Estimate
from nutdamp.montecarlo.cases import DispersedCases, number_of
from nutdamp.montecarlo.propagated import Ends, RealWidths
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.planning import decision
from nutdamp.schemes import planner
from nutdamp.spacecraft.model import Requirement
from nutdamp.views.fit import ESTIMATES, advice, fit_screen, prospect_table
from nutdamp.views.tables import DataTable

SPIN, LENGTH = math.pi, 30.0


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Fitted:
    """Half a minute of 2 Hz gyros of the example, with another C."""
    times = np.linspace(0.0, LENGTH, 61)
    rates = np.degrees(motion((120.0, 120.0, 80.4), np.array([0.14, 0.12, SPIN]), times))
    rates += 0.01 * np.random.default_rng(16).normal(size=rates.shape)
    path = tmp_path_factory.mktemp("fit") / "flight.csv"
    header = "t_s," + ",".join(f"omega_{axis}_deg_s" for axis in (1, 2, 3))
    np.savetxt(path, np.column_stack([times, rates]), "%.5f", ",", header=header, comments="")
    return fit(path, nutdamp.example())


def shown(renderable: object) -> str:
    console = Console(file=io.StringIO(), width=120)
    console.print(renderable)
    return console.file.getvalue()  # type: ignore[attr-defined, no-any-return]


def test_estimates_file_and_json_are_one(fitted: Fitted, tmp_path: Path) -> None:
    assert fitted.warnings == ()
    at = 45.0
    rows, data = {one.key: one for one in fitted.estimates(at)}, fitted.to_dict(at)
    ratio = rows["C/A"]
    assert ratio.value == pytest.approx(0.67, abs=4.0 * ratio.sigma)
    written = {one["quantity"]: one for one in data["estimates"]}
    assert written["C/A"]["value"] == pytest.approx(ratio.value, rel=1e-12)
    for key, one in rows.items():
        assert written[key]["sigma"] == pytest.approx(one.sigma * one.factor)
    fitted.write(tmp_path / "now.yaml", at)
    assert (tmp_path / "now.yaml").read_text() == fitted.text(at)
    body = fitted.spacecraft(at)
    true = motion((120.0, 120.0, 80.4), np.array([0.14, 0.12, SPIN]), np.array([0.0, at]))[-1]
    of_file = body.inertia.C / body.inertia.A
    assert of_file == pytest.approx(ratio.value, rel=1e-8)
    assert body.omega0 == pytest.approx(true, abs=1e-3)
    assert body.dispersions is not None
    assert {pair[:2]: pair[2] for pair in body.dispersions.correlation}["A", "C"] > 0.999


def test_only_a_spacecraft_of_a_file_makes_one(fitted: Fitted) -> None:
    model = copy(fitted.core.model)
    model.spacecraft = replace(model.spacecraft, name="of no file")
    with refused(BadRequest, "estimation.no-file"):
        Fitted(replace(fitted.core, model=model)).text()


def test_the_screen_says_how_many_periods_the_record_has(fitted: Fitted) -> None:
    values = fitted.core.named
    periods = re.search(r"0 s to 30 s, nutation periods: (\S+)", shown(fit_screen(fitted.core, 0.0)))
    assert periods is not None
    expected = LENGTH * (1.0 - values["C/A"]) * values["omega_3"] / (2.0 * math.pi)
    assert float(periods[1]) == pytest.approx(expected, rel=5e-3)


def test_the_default_screen_is_short(fitted: Fitted) -> None:
    brief, full = (shown(fit_screen(fitted.core, 0.0, verbose=verbose)) for verbose in (False, True))
    lines = brief.splitlines()
    assert len(lines) <= 40
    assert lines[-1].startswith("-v all values")
    ratio, same = ([row for row in text.splitlines() if row.startswith("C/A")] for text in (brief, full))
    assert ratio == same
    assert "samples" in full
    assert "samples" not in brief


def test_values_are_shown_to_what_their_sigmas_leave() -> None:
    def row(value: float, sigma: float) -> Estimate:
        return Estimate("x", f"{value:g} ± {sigma:g}", "m", 1.0, value, sigma, 1.0, 0.5)

    def screen(*rows: Estimate) -> str:
        return shown(DataTable("Estimates", ESTIMATES, rows).screen("screen"))

    pairs = ((1.23456789, 1e-4), (1.23456789, 2.0), (1.23456789, 1.2), (0.0, 0.1), (1e-9, 1.0), (1.0, math.inf))
    check_text("estimation.digits", screen(*(row(*pair) for pair in pairs)))
    (scaled,) = screen(Estimate("x", "x", "mm", 1e3, 0.0123, 1e-4, 0.012, 1e-3)).splitlines()[-1:]
    assert scaled.split()[:6] == ["x", "12.3", "0.1", "mm", "12", "+0.3"]


def test_longer_coasts_tell_more_and_a_probe_pulse_its_thrust(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forecast, "CASES", 200)
    monkeypatch.setattr(forecast, "LENGTHS", (0.25, 1.0, 4.0))
    monkeypatch.setattr(decision, "usual", lambda _: ("one-pulse",))
    done: list[int] = []
    ahead = forecast.outlook(fitted.core, 45.0, done.append)
    ratios = [one.ratio for one in ahead.coasts]
    assert [one.length for one in ahead.coasts] == [7.5, 30.0, 120.0]
    assert ahead.now.ratio == pytest.approx(fitted.core.sigmas[fitted.core.index("C/A") or 0], rel=0.1)
    assert ratios == sorted(ratios, reverse=True)
    assert ahead.scheme == "one-pulse"
    (probe,) = ahead.probes
    assert done == [1, 2, 3, 4]
    assert probe.length == 30.0
    assert 0.0 < probe.thrust < 0.01 < probe.on_time
    assert (probe.propellant or 0.0) > 0.0
    assert probe.nutation < ahead.now.nutation  # which comes from the thrust


@pytest.mark.parametrize(("scheme", "shift", "level"), [("one-pulse", None, 0.997), ("optimal", 0.12, 0.5)])
def test_cases_near_a_bound_are_flown_and_the_others_cannot_pass_it(
    scheme: str, shift: float | None, level: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As all cases flown, of which a part meets the requirement."""
    required = Requirement(math.radians(0.12), None if shift is None else math.radians(shift))
    body, flown = replace(nutdamp.example(), requirement=required), list[int]()
    study = study_of(body, planner.schedule(scheme, body))
    exact = run(Results(study, forecast.CASES))
    flies = RealWidths.__call__

    def counted(self: RealWidths, cases: DispersedCases) -> Ends:
        flown.append(number_of(cases))
        return flies(self, cases)

    monkeypatch.setattr(RealWidths, "__call__", counted)
    nutation, met = forecast.left_in_cases(study, level)
    assert exact.values is not None
    assert met is not None
    assert nutation == pytest.approx(float(np.quantile(exact.values[0], level)), rel=1e-9)
    assert met == exact.met_fraction
    assert 0.01 < met < 0.99
    assert sum(flown) < 0.5 * forecast.CASES


def test_what_pays_is_said_once_it_does() -> None:
    """Nutations left in deg: by coasts of 15, 30, 60 and 120 s, of which 30 s is the record, and by a probe pulse."""
    lines = []
    for nutations, probe, met in (
        ((0.5, 0.4, 0.39, 0.38), None, 0.5),
        ((0.5, 0.4, 0.3, 0.1), 0.35, 0.5),
        ((0.5, 0.4, 0.39, 0.38), 0.39, None),
        ((0.5, 0.4, 0.3, 0.1), 0.1, 0.999),
    ):
        lengths = (15.0, 30.0, 60.0, 120.0)
        coasts = [Prospect(one, 1e-4, math.radians(left), met) for one, left in zip(lengths, nutations, strict=True)]
        coasts.insert(0, Prospect(7.5, 2e-4, 0.02, met))
        probes = () if probe is None else (Prospect(30.0, 1e-4, math.radians(probe), met, "T1", 0.5, 0.01, 0.004),)
        lines += [noted(advice(Outlook("optimal", tuple(coasts), probes, 0.997, 0.1))), "-"]
    check_text("estimation.advice", "\n".join(lines))


def test_a_probe_pulse_that_gains_more_per_propellant_is_named_beside_the_one_that_leaves_least() -> None:
    """Of 0.4 deg 4 g leave 0.1 deg, 75 deg/kg, and 1 g 0.3 deg, 100 deg/kg; 0.1 g, 0.39 deg, too much to pay."""
    left = {"T1": (0.1, 0.004), "T2": (0.3, 0.001), "T3": (0.39, 0.0001), "T4": (0.2, None)}
    probes = [Prospect(30.0, 1e-4, math.radians(one), 0.5, name, 0.5, 0.01, kg) for name, (one, kg) in left.items()]
    coasts = [Prospect(length, 1e-4, math.radians(0.4), 0.5) for length in (7.5, 15.0, 30.0, 60.0, 120.0)]
    ahead = Outlook("optimal", tuple(coasts), tuple(probes), 0.997, 0.1)
    assert ahead.probe is probes[0]
    assert ahead.thrifty is probes[1]
    gains = [ahead.gain(probe) for probe in probes]
    assert [gain and math.degrees(gain) for gain in gains] == [*map(pytest.approx, (75.0, 100.0, 100.0)), None]
    check_text("estimation.advice-propellant", noted(advice(ahead)))
    table = shown(prospect_table(ahead).screen("screen"))
    assert "0.075" in table
    assert "gain" in table

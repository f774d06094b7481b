"""Results of a fit: its file, its JSON, its screen."""

import io
import math
import re
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from support.builders import present
from support.golden import check_text, refused
from support.synthetic import motion

import nutdamp
from nutdamp.api import fit
from nutdamp.errors import BadRequest
from nutdamp.estimation.results import Estimate, Fitted
from nutdamp.views.fit import ESTIMATES, fit_screen
from nutdamp.views.tables import DataTable

SPIN = math.pi
LENGTH = 30.0


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
    rows = {one.key: one for one in fitted.estimates(at)}
    data = fitted.to_dict(at)
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
    assert {pair[:2]: pair[2] for pair in present(body.dispersions).correlation}["A", "C"] > 0.999


def test_only_a_spacecraft_of_a_file_makes_one(fitted: Fitted) -> None:
    model = copy(fitted.core.model)
    model.spacecraft = replace(model.spacecraft, name="of no file")
    with refused(BadRequest, "estimation.no-file"):
        Fitted(replace(fitted.core, model=model)).text()


def test_the_screen_says_how_many_periods_the_record_has(fitted: Fitted) -> None:
    values = fitted.core.named
    periods = present(
        re.search(r"0 s to 30 s, nutation periods: (\S+)", shown(fit_screen(fitted.core, 0.0)))
    )
    expected = LENGTH * (1.0 - values["C/A"]) * values["omega_3"] / (2.0 * math.pi)
    assert float(periods[1]) == pytest.approx(expected, rel=5e-3)


def test_the_default_screen_is_short(fitted: Fitted) -> None:
    brief, full = (
        shown(fit_screen(fitted.core, 0.0, verbose=verbose)) for verbose in (False, True)
    )
    lines = brief.splitlines()
    assert len(lines) <= 40
    assert lines[-1].startswith("-v all values")
    ratio, same = (
        [row for row in text.splitlines() if row.startswith("C/A")] for text in (brief, full)
    )
    assert ratio == same
    assert "samples" in full
    assert "samples" not in brief


def test_values_are_shown_to_what_their_sigmas_leave() -> None:
    def row(value: float, sigma: float) -> Estimate:
        return Estimate("x", f"{value:g} ± {sigma:g}", "m", 1.0, value, sigma, 1.0, 0.5)

    def screen(*rows: Estimate) -> str:
        return shown(DataTable("Estimates", ESTIMATES, rows).screen("screen"))

    pairs = (
        (1.23456789, 1e-4),
        (1.23456789, 2.0),
        (1.23456789, 1.2),
        (0.0, 0.1),
        (1e-9, 1.0),
        (1.0, math.inf),
    )
    check_text("estimation.digits", screen(*(row(*pair) for pair in pairs)))
    (scaled,) = screen(Estimate("x", "x", "mm", 1e3, 0.0123, 1e-4, 0.012, 1e-3)).splitlines()[-1:]
    assert scaled.split()[:6] == ["x", "12.3", "0.1", "mm", "12", "+0.3"]

"""What the library refuses, with errors of its own that say what was expected."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.tilted import TILTED

import nutdamp
from nutdamp import errors, planning
from nutdamp.schemes.options import OptimalOptions


@pytest.fixture
def craft() -> nutdamp.Spacecraft:
    return nutdamp.example()


def test_what_cannot_be_says_so_in_an_error_of_the_package(craft: nutdamp.Spacecraft, tmp_path: Path) -> None:
    ideal = nutdamp.read("name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n")
    infeasible = nutdamp.plan(ideal, "four-pulse")
    assert not infeasible.feasible
    assert len(infeasible.to_numpy()) == len(infeasible) == 0
    plan = nutdamp.plan(craft, "two-pulse")
    for kind, call in (
        (errors.CannotRead, lambda: nutdamp.load(tmp_path / "missing.yaml")),
        (errors.FaultyFile, lambda: nutdamp.read("name: X\n")),
        (errors.BadRequest, lambda: nutdamp.plan(craft, "three-pulse")),
        (errors.BadRequest, lambda: nutdamp.compare(craft, ["three-pulse"])),
        (errors.BadRequest, lambda: nutdamp.plan(craft, "four-pulse", nutdamp.Options(on_time=-1.0))),
        (errors.BadRequest, lambda: nutdamp.plan(craft, "optimal", nutdamp.Options(least="fuel"))),
        (errors.BadRequest, lambda: plan.fly(until=-1.0)),
        (errors.BadRequest, lambda: plan.fly(samples=1)),
        (errors.BadRequest, lambda: plan.fly().figure("portrait")),
        (errors.Infeasible, infeasible.fly),
        (errors.Infeasible, lambda: infeasible.to_csv(tmp_path / "pulses.csv")),
        (errors.CannotWrite, lambda: plan.to_csv(tmp_path / "no" / "pulses.csv")),
    ):
        with pytest.raises(kind):
            call()
        assert issubclass(kind, nutdamp.NutdampError)
    assert list(tmp_path.iterdir()) == []


WRONG: dict[str, tuple[Callable[[Any, Any], object], str]] = {
    "an option of 0": (
        lambda craft, _: nutdamp.plan(craft, "rhumb-line", nutdamp.Options(per_turn=0)),
        "per_turn = 0: expected a whole number of at least 1",
    ),
    "a negative count": (
        lambda craft, _: nutdamp.plan(craft, "half-cone", nutdamp.Options(cones=-3)),
        "cones = -3: expected a whole number of at least 1",
    ),
    "a negative angle": (
        lambda craft, _: nutdamp.plan(craft, "optimal", nutdamp.Options(shift=-0.1)),
        "shift = -0.1: expected an angle of at least 0, in rad",
    ),
    "an angle beside freedom": (
        lambda craft, _: nutdamp.compare(craft, ["optimal"], nutdamp.Options(shift=0.1, free_axis=True)),
        "shift = 0.1: expected none beside a free axis",
    ),
    "a time that is no number": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", nutdamp.Options(on_time=math.nan)),
        "on_time = nan: expected a time above zero, in s",
    ),
    "a time as text": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", nutdamp.Options(on_time="3 s")),
        "on_time = '3 s': expected a time above zero, in s",
    ),
    "a flag as number": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", nutdamp.Options(coarse=1)),
        "coarse = 1: expected True or False",
    ),
    "an option of no scheme": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", nutdamp.Options(length=0.2)),
        "options: no scheme has 'length'; there are with_disturbances, on_time",
    ),
    "options of another scheme": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", OptimalOptions(least="time")),
        "options of four-pulse: expected FourPulseOptions(…), got a nutdamp.schemes.options.OptimalOptions",
    ),
    "options as mapping": (
        lambda craft, _: nutdamp.plan(craft, "four-pulse", {"on_time": 3}),  # type: ignore[arg-type]
        "options: expected nutdamp.Options(…), got a dict",
    ),
    "a file name as spacecraft": (
        lambda *_: nutdamp.plan("spacecraft.yaml", "two-pulse"),  # type: ignore[arg-type]
        "spacecraft: expected a Spacecraft, as nutdamp.load gives it, got 'spacecraft.yaml'",
    ),
    "a plan as spacecraft": (
        lambda _, plan: nutdamp.compare(plan),
        "expected a Spacecraft, as nutdamp.load gives it, got a nutdamp.planning.Plan",
    ),
    "a mapping as text": (
        lambda *_: nutdamp.read({"name": "X"}),  # type: ignore[arg-type]
        "text: expected the text of a spacecraft file (nutdamp.load reads files), got a dict",
    ),
    "a number as file": (lambda *_: nutdamp.load(3), "path: expected the name of a file or a dict of its keys, got 3"),  # type: ignore[arg-type]
    "bytes as file": (lambda *_: nutdamp.load(b"x"), "expected the name of a file or a dict of its keys, got a bytes"),  # type: ignore[arg-type]
    "a number as schedule": (
        lambda craft, _: nutdamp.load_schedule(3, craft),  # type: ignore[arg-type]
        "path: expected the name of a file, got 3",
    ),
    "an object in a dict": (
        lambda *_: nutdamp.load({"name": object()}),
        "dict: expected a number, a text, a list or a mapping, got object",
    ),
    "an object to change": (
        lambda craft, _: craft.with_(limits={"horizon": object()}),
        "expected a number, a text, a list or a mapping, got object",
    ),
    "a number as key": (lambda craft, _: craft.with_(limits={3: 4}), "with_ limits: expected the name of a key, got 3"),
    "a spacecraft without a file": (
        lambda craft, _: craft.replace(mass=3).with_(name="X"),
        "with_: expected a spacecraft from nutdamp.load, read or example",
    ),
    "a text as mass": (lambda craft, _: craft.replace(mass="3 kg"), "mass: expected a number or None, got '3 kg'"),
    "two rates": (lambda craft, _: craft.replace(omega0=(0.1, 3.0)), "omega0: expected three numbers, got a tuple"),
    "names as channels": (
        lambda craft, _: craft.replace(channels=("+M1",)),
        "channels: expected a tuple of Channel, got a tuple",
    ),
    "an unknown field": (lambda craft, _: craft.replace(weight=3), "replace: there is no 'weight'; there are name"),
    "a plan to report": (
        lambda _, plan: nutdamp.report(plan),
        "path: expected the name of a file or a dict of its keys, got a nutdamp.planning.Plan",
    ),
    "another ending": (lambda craft, _: nutdamp.report(craft, "page.txt"), "page.txt: a report is written as HTML"),
    "a number to change": (
        lambda *_: nutdamp.load("x", set={3: 4}),  # type: ignore[dict-item]
        "set: expected a mapping such as {'limits.horizon': '300 s'}, got a dict",
    ),
    "one name for several": (
        lambda craft, _: nutdamp.compare(craft, "two-pulse"),
        "names: expected a list of schemes, such as ['two-pulse'], got 'two-pulse'",
    ),
    "an array as scheme": (
        lambda craft, _: nutdamp.plan(craft, np.zeros(2)),  # type: ignore[arg-type]
        "there is no scheme a numpy.ndarray; there are one-pulse",
    ),
    "no points": (lambda craft, _: nutdamp.trade(craft, 0), "points = 0: expected a whole number of at least 1"),
    "one angle": (lambda craft, _: nutdamp.trade(craft, allow=0.1), "allow = 0.1: expected angles of at least 0"),  # type: ignore[arg-type]
    "a negative shift": (lambda craft, _: nutdamp.trade(craft, allow=[-0.1]), "expected angles of at least 0, in rad"),
    "least time": (
        lambda craft, _: nutdamp.trade(craft, least="time"),
        "least = 'time': expected one of propellant, impulse",
    ),
    "a scheme to verify": (
        lambda *_: nutdamp.verify("two-pulse"),  # type: ignore[arg-type]
        "plan: expected a Plan, as nutdamp.plan gives it, got 'two-pulse'",
    ),
    "no dispersions": (
        lambda *_: nutdamp.disperse(nutdamp.plan(nutdamp.read(TILTED), "none")),
        "the spacecraft has no dispersions",
    ),
    "an unknown format": (
        lambda _, plan: nutdamp.export(plan, "oem", "x"),
        "format = 'oem': expected one of apm, aem, aem-spin, opm, stk, spin-table, basilisk, json",
    ),
    "an end as text": (lambda _, plan: plan.fly(until="3"), "until = '3': expected a time after t = 0, in s"),
    "half a sample": (lambda _, plan: plan.fly(samples=2.5), "samples = 2.5: expected a whole number of at least 2"),
    "a number as output": (lambda _, plan: plan.to_csv(3), "path: expected the name of a file, got 3"),
    "a list as figure": (lambda _, plan: plan.fly().figure([]), "expected the name of a figure, got a list"),
}


@pytest.mark.parametrize(("call", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_argument_is_reported_with_what_was_expected(
    craft: nutdamp.Spacecraft, call: Callable[[Any, Any], object], message: str
) -> None:
    with pytest.raises(errors.BadRequest, match=re.escape(message)):
        call(craft, nutdamp.plan(craft, "none"))


def test_numbers_of_numpy_are_numbers(craft: nutdamp.Spacecraft) -> None:
    options = nutdamp.Options(on_time=np.float64(0.5), per_turn=np.int64(2))
    plan = nutdamp.plan(craft, "four-pulse", options)
    assert max(plan.to_numpy()["on_time_s"]) == 0.5
    flight = plan.fly(until=np.float64(3.0), samples=np.int64(5))  # type: ignore[arg-type]
    assert len(flight.track.t) >= 5


def test_an_unknown_scheme_is_refused_without_nutation_too() -> None:
    calm = nutdamp.read("name: X\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n")
    assert nutdamp.plan(calm, "two-pulse").feasible
    with pytest.raises(errors.BadRequest, match="there is no scheme 'three-pulse'"):
        nutdamp.plan(calm, "three-pulse")
    for call in (planning.plan, planning.alternatives):
        with pytest.raises(KeyError):
            call(calm, "three-pulse")

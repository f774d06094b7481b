"""Plans under energy dissipation: what the flight leaves, what is claimed, and that every search ends."""

from __future__ import annotations

import cmath
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import aimed, channel, spinner
from support.cases import spread, weekly
from support.places import case
from support.process import Run

from nutdamp import flight, planning
from nutdamp.physics import rigid
from nutdamp.planning import plan
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Schedule
from nutdamp.schemes.tools.impulse_builder import ImpulseBuilder
from nutdamp.spacecraft import Limits, Spacecraft, Steerable

NEARLY_NOTHING = math.radians(1e-7)

COURSE = """
name: X
inertia: {A: 2000, C: 1000}
omega0: [0.10 rad/s, 0, 60 rpm]
dissipation: {time_constant: 100 s}
"""


def random_body(seed: int) -> Spacecraft:
    """Prolate or oblate, 1 to 50 degrees, one to four channels, time constants of 1 to 1000 inertial periods."""
    draw = np.random.default_rng(seed)
    A = 100.0
    C = A * (draw.uniform(0.2, 0.85) if draw.random() < 0.5 else draw.uniform(1.15, 1.95))
    spin = draw.choice([-1.0, 1.0]) * draw.uniform(0.5, 5.0)
    degrees = float(draw.choice([1.0, 3.0, 10.0, 30.0, 50.0]))
    size = C * abs(spin) * math.tan(math.radians(degrees)) * draw.uniform(0.5, 2.0) * abs(spin)
    along = {"+M1": (size, 0.0, 0.0), "-M1": (-size, 0.0, 0.0), "+M2": (0.0, size, 0.0), "-M2": (0.0, -size, 0.0)}
    channels = tuple(channel(name, *torque) for name, torque in along.items())[: draw.integers(1, 5)]
    body = spinner(A=A, C=C, spin=spin, degrees=degrees, phase=draw.uniform(0.0, 6.28), channels=channels)
    return replace(body, dissipation=body.inertial_period * 10.0 ** draw.uniform(0.0, 3.0))


def left_by_reference(one: planning.Plan) -> tuple[float, float]:
    """Nutation and shift of H, rad, by DOP853 on H in space and the attitude."""
    body, moments = one.spacecraft, one.spacecraft.inertia.moments
    events: list[reference.Push | reference.Kick] = [
        reference.Kick(pulse.t, pulse.impulse)
        if pulse.torque is None
        else reference.Push(pulse.start, pulse.end, pulse.torque)
        for pulse in one.pulses
    ]
    start = reference.frame_n(moments, body.omega0)
    end = reference.fly(moments, body.omega0, events, one.pulses.end, start, body.growth)
    before = start @ (np.asarray(moments) * body.omega0)
    shift = reference.angle(before, reference.momentum(moments, end))
    return reference.nutation(moments, end.rates, math.copysign(1.0, body.spin)), shift


@pytest.mark.parametrize("scheme", ["one-pulse", "four-pulse", weekly("two-pulse"), weekly("optimal")])
def test_random_bodies_are_damped_and_the_flight_is_true(scheme: str) -> None:
    damped = 0
    for seed in range(8):
        one = plan(random_body(seed), scheme)
        if one.flown is None:
            continue
        nutation, shift = left_by_reference(one)
        assert one.flown.nutation == pytest.approx(nutation, abs=1e-9)
        assert one.flown.momentum_shift == pytest.approx(shift, abs=1e-9)
        assert one.residual is not None
        # What the impulse sum misses of a width is of the order of what dissipation does within one turn.
        slow = abs(one.spacecraft.growth) * one.spacecraft.inertial_period
        assert one.residual.nutation == pytest.approx(nutation, abs=0.03 * slow * one.spacecraft.nutation)
        damped += one.flown.nutation < NEARLY_NOTHING
    assert damped >= 7


@spread("steerable", [Steerable(), Steerable(400.0)], quick=1, ids=["ideal", "torquer"])
@spread("scheme", ["two-pulse", "half-cone", "rhumb-line"], quick=1)
@spread("C", [60.0, 160.0], quick=3)
def test_targets_are_reached(steerable: Steerable, scheme: str, C: float) -> None:
    body = aimed(replace(spinner(A=100.0, C=C, steerable=steerable), dissipation=40.0), 20.0, 70.0)
    one = plan(body, scheme)
    assert one.flown is not None, infeasibility(one)
    assert one.flown.nutation < NEARLY_NOTHING
    assert one.flown.axis_error < NEARLY_NOTHING


@pytest.mark.parametrize("C", [40.0, 80.0, 150.0])
@pytest.mark.parametrize("spin", [2.0, -2.0])
def test_a_walk_coasts_as_the_flight_does(C: float, spin: float) -> None:
    body = replace(spinner(A=100.0, C=C, spin=spin, degrees=50.0), dissipation=12.0)
    builder = ImpulseBuilder(body)
    times = np.linspace(0.0, 40.0, 9)
    rates, _ = flight.flown(body, Schedule(), 40.0).motion(times)
    for time, row in zip(times, rates, strict=True):
        assert builder.omega_at(float(time)) == pytest.approx(complex(row[0], row[1]), abs=1e-12)


def test_alignments_are_found_while_the_spin_falls_and_none_in_flat_spin() -> None:
    """At 50 degrees, τ = 12 s: the turns of ω in the body get longer, and after some there are no more."""
    jet = channel("+M1", 5.0, 0.0, 0.0)
    body = replace(
        spinner(A=100.0, C=40.0, spin=3.0, degrees=50.0, channels=(jet,), limits=Limits(horizon=1e5)), dissipation=12.0
    )
    found = []
    for earliest in np.arange(0.0, 60.0, 2.0):
        builder = ImpulseBuilder(replace(body, limits=replace(body.limits, earliest=float(earliest))))
        pulse = builder.align(jet, 0.01)
        if pulse is None:
            break
        omega = builder.omega_at(pulse.t)
        turn = cmath.phase(-omega * builder.acts(pulse).conjugate())
        assert abs(turn) < 1e-9
        assert pulse.start >= earliest
        found.append(pulse.t)
    waits = np.diff(np.unique(np.round(found, 6)))
    assert 3 < len(found) < 30
    assert waits[-1] > 1.5 * waits[0]


@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse", "four-pulse", "optimal"])
def test_coasts_take_no_steps(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With dissipation, only the pulses are integrated: a long wait between them costs nothing."""
    spans = []
    integrate = rigid.integrate

    def counted(*args: object, **named: object) -> object:
        spans.append(float(args[5]) - float(args[4]))  # type: ignore[arg-type]
        return integrate(*args, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(rigid, "integrate", counted)
    names = {"+M1": (5.0, 0.0, 0.0), "-M1": (-5.0, 0.0, 0.0), "+M2": (0.0, 5.0, 0.0)}
    jets = tuple(channel(name, *torque, max_on_time=0.5) for name, torque in names.items())
    body = replace(spinner(channels=jets, limits=Limits(horizon=400.0)), dissipation=300.0)
    assert plan(body, scheme).feasible
    assert spans
    assert max(spans) < 0.501  # the longest pulse, and a little more for difference quotients


# --- what is claimed -------------------------------------------------------------------------------------------------


def test_no_bound_is_claimed_under_dissipation(run: Run) -> None:
    shown = run("plan", str(case("oblate-dissipation.yaml")), "--scheme", "optimal").stdout
    assert "no least impulse with dissipation" in shown
    assert "no schedule" not in shown
    data = json.loads(run("plan", str(case("oblate-dissipation.yaml")), "--scheme", "optimal", "--json", "-").stdout)
    # An oblate body damps itself: there are schedules below A|ω0|, and they are found.
    assert data["plans"][0]["total_impulse_Nms"] < 0.65 * data["plans"][0]["least_impulse_Nms"]


def test_the_first_order_least_knows_dissipation() -> None:
    """Small angles: with κ the optimum waits (oblate) or hurries (prolate), and costs what the program says."""
    names = {"+M1": (5.0, 0.0, 0.0), "-M1": (-5.0, 0.0, 0.0), "+M2": (0.0, 5.0, 0.0), "-M2": (0.0, -5.0, 0.0)}
    jets = tuple(channel(name, *torque, max_on_time=0.5) for name, torque in names.items())
    for A, C in ((80.0, 120.0), (120.0, 80.0)):
        body = replace(spinner(A=A, C=C, degrees=0.5, channels=jets, limits=Limits(horizon=60.0)), dissipation=100.0)
        one = plan(body, "optimal")
        bounds = one.pulses.bounds
        assert bounds is not None
        assert bounds.first_order is not None
        assert bounds.rigorous is None
        assert one.pulses.total_impulse == pytest.approx(bounds.first_order, rel=0.01)
        assert (bounds.first_order < 0.6 * body.least_impulse) == (A < C)
        assert left_by_reference(one)[0] < 1e-9


@pytest.mark.weekly
def test_what_dissipation_takes_out_alone_leaves_pulses_that_can_be_commanded() -> None:
    """An oblate body, 30 time constants of horizon: the longer it waits, the less it costs, without end."""
    names = {"+M1": (400.0, 0.0, 0.0), "-M1": (-400.0, 0.0, 0.0), "+M2": (0.0, 400.0, 0.0)}
    jets = tuple(channel(name, *torque) for name, torque in names.items())
    body = replace(spinner(A=80.0, C=120.0, channels=jets, limits=Limits(horizon=600.0)), dissipation=20.0)
    one = plan(body, "optimal")
    assert one.flown is not None, infeasibility(one)
    assert one.flown.nutation < NEARLY_NOTHING
    assert all(pulse.resolved for pulse in one.pulses)
    assert one.pulses.total_impulse < 1e-3 * body.least_impulse
    assert one.pulses.bounds is not None
    assert one.pulses.bounds.within < 300.0  # the least within as long as the search looks


# --- files that went wrong -------------------------------------------------------------------------------------------


@spread(
    ("name", "options", "status"),
    [
        ("crash-hang-near-sphere-dissipation.yaml", (), 3),
        ("crash-dissipation-near-sphere-overflow.yaml", (), 3),
        ("crash-halfcone-trim-crash.yaml", (), 0),
        ("crash-target-ideal-torquer-dissipation.yaml", ("--target", "5deg,0deg"), 0),
        ("crash-dissipation-short.yaml", (), 0),
    ],
    quick=2,
)
def test_files_that_went_wrong(run: Run, name: str, options: tuple[str, ...], status: int) -> None:
    done = run("plan", str(case(name)), *options)
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
    assert "nan" not in done.stdout.split()


def test_a_nutation_that_damps_itself_first_needs_no_channel(run: Run) -> None:
    """Near a sphere ω takes days to turn in the body, and dissipation minutes to take it out."""
    shown = " ".join(run("plan", str(case("crash-hang-near-sphere-dissipation.yaml"))).stdout.split())
    assert "dissipation takes the nutation out before a channel comes to oppose it" in shown
    assert "dissipation takes the nutation out before the channels (T) come to oppose it" in shown


def test_a_target_on_the_spin_axis_takes_one_impulse() -> None:
    body = aimed(replace(spinner(steerable=Steerable()), dissipation=1000.0), 5.0, 0.0)
    for scheme in ("two-pulse", "half-cone"):
        one = plan(body, scheme)
        assert one.flown is not None, infeasibility(one)
        assert len(one.pulses) == 1
        assert max(one.flown.nutation, one.flown.axis_error) < 1e-12


def test_dissipation_faster_than_a_turn_is_flown_and_said(run: Run) -> None:
    shown = " ".join(run("plan", str(case("crash-dissipation-short.yaml"))).stdout.split())
    assert "the nutation grows e-fold in 1 s; less than one inertial period: results are rough" in shown


def test_the_course_example_is_no_flat_spin_at_345_s(run: Run) -> None:
    done = run(
        "simulate",
        "-",
        *("--scheme", "none", "--flown", "--until", "345 s", "--samples", "2", "--csv", "-"),
        stdin=COURSE,
    )
    assert done.returncode == 0, done.stderr
    header, *_, last = [line.split(",") for line in done.stdout.splitlines()]
    assert float(last[header.index("nutation_deg")]) == pytest.approx(45.08, abs=0.005)

"""Plans under energy dissipation: what the flight leaves, what is claimed, and that every search ends."""

from __future__ import annotations

import cmath
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import aimed, channel, events, spinner
from support.cases import deep, spread, weekly
from support.golden import check_text
from support.places import case
from support.process import Run

from nutdamp import flight, planning
from nutdamp.physics import rigid
from nutdamp.planning import plan
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Schedule
from nutdamp.schemes.tools.impulse_builder import ImpulseBuilder
from nutdamp.spacecraft import Channel, Limits, Spacecraft, Steerable

NEARLY_NOTHING = math.radians(1e-7)


def jets(torque: float, count: int = 4, longest: float = math.inf) -> tuple[Channel, ...]:
    """+1, -1, +2, -2, or the first of these."""
    along = [(torque, 0.0), (-torque, 0.0), (0.0, torque), (0.0, -torque)]
    return tuple(channel(f"M{n}", *one, 0.0, max_on_time=longest) for n, one in enumerate(along[:count]))


def random_body(seed: int) -> Spacecraft:
    """Prolate or oblate, 1 to 50 degrees, one to four channels, time constants of 1 to 1000 inertial periods."""
    draw = np.random.default_rng(seed)
    C = 100.0 * (draw.uniform(0.2, 0.85) if draw.random() < 0.5 else draw.uniform(1.15, 1.95))
    spin, degrees = draw.choice([-1.0, 1.0]) * draw.uniform(0.5, 5.0), float(draw.choice([1.0, 3.0, 10.0, 30.0, 50.0]))
    size = C * abs(spin) * math.tan(math.radians(degrees)) * draw.uniform(0.5, 2.0) * abs(spin)
    channels = jets(size, int(draw.integers(1, 5)))
    body = spinner(A=100.0, C=C, spin=spin, degrees=degrees, phase=draw.uniform(0.0, 6.28), channels=channels)
    return replace(body, dissipation=body.inertial_period * 10.0 ** draw.uniform(0.0, 3.0))


def left_by_reference(one: planning.Plan) -> tuple[float, float]:
    """Nutation and shift of H, rad, by DOP853 on H in space and the attitude."""
    body, moments = one.spacecraft, one.spacecraft.inertia.moments
    start = reference.frame_n(moments, body.omega0)
    end = reference.fly(moments, body.omega0, events(one.pulses), one.pulses.end, start, body.growth)
    shift = reference.angle(start @ (np.asarray(moments) * body.omega0), reference.momentum(moments, end))
    return reference.nutation(moments, end.rates, math.copysign(1.0, body.spin)), shift


@pytest.mark.parametrize("scheme", ["one-pulse", deep("four-pulse"), weekly("two-pulse"), weekly("optimal")])
def test_random_bodies_are_damped_and_the_flight_is_true(scheme: str) -> None:
    damped = 0
    for seed in range(8):
        one = plan(random_body(seed), scheme)
        if one.flown is None:
            continue
        nutation, shift = left_by_reference(one)
        assert (one.flown.nutation, one.flown.momentum_shift) == pytest.approx((nutation, shift), abs=1e-9)
        assert one.residual is not None
        # What the impulse sum misses of a width is of the order of what dissipation does within one turn.
        slow = abs(one.spacecraft.growth) * one.spacecraft.inertial_period
        assert one.residual.nutation == pytest.approx(nutation, abs=0.03 * slow * one.spacecraft.nutation)
        damped += one.flown.nutation < NEARLY_NOTHING
    assert damped >= 7


@spread("steerable", [Steerable(), Steerable(400.0)], quick=1, ids=["ideal", "torquer"])
@spread("scheme", ["two-pulse", "half-cone", "rhumb-line"], quick=1)
@spread("C", [60.0, 160.0], quick=2)
def test_targets_are_reached(steerable: Steerable, scheme: str, C: float) -> None:
    one = plan(aimed(replace(spinner(A=100.0, C=C, steerable=steerable), dissipation=40.0), 20.0, 70.0), scheme)
    assert one.flown is not None, infeasibility(one)
    assert max(one.flown.nutation, one.flown.axis_error) < NEARLY_NOTHING


def test_a_target_on_the_spin_axis_takes_one_impulse() -> None:
    for scheme in ("two-pulse", "half-cone"):
        one = plan(aimed(replace(spinner(steerable=Steerable()), dissipation=1000.0), 5.0, 0.0), scheme)
        assert one.flown is not None, infeasibility(one)
        assert len(one.pulses) == 1
        assert max(one.flown.nutation, one.flown.axis_error) < 1e-12


@pytest.mark.parametrize("C", [40.0, 80.0, 150.0])
@pytest.mark.parametrize("spin", [2.0, -2.0])
def test_a_walk_coasts_as_the_flight_does(C: float, spin: float) -> None:
    body, times = replace(spinner(100.0, C, spin, degrees=50.0), dissipation=12.0), np.linspace(0.0, 40.0, 9)
    rates, _ = flight.flown(body, Schedule(), 40.0).motion(times)
    omegas = [ImpulseBuilder(body).omega_at(float(time)) for time in times]
    assert omegas == pytest.approx(rates[:, 0] + 1j * rates[:, 1], abs=1e-12)


def test_alignments_are_found_while_the_spin_falls_and_none_in_flat_spin() -> None:
    """At 50 degrees, τ = 12 s: the turns of ω in the body get longer, and after some there are no more."""
    (jet,), moments = jets(5.0, 1), list[float]()
    for earliest in np.arange(0.0, 60.0, 2.0):
        limits = Limits(horizon=1e5, earliest=float(earliest))
        body = replace(spinner(100.0, 40.0, 3.0, 50.0, channels=(jet,), limits=limits), dissipation=12.0)
        builder = ImpulseBuilder(body)
        pulse = builder.align(jet, 0.01)
        if pulse is None:
            break
        assert abs(cmath.phase(-builder.omega_at(pulse.t) * builder.acts(pulse).conjugate())) < 1e-9
        assert pulse.start >= earliest
        moments.append(pulse.t)
    waits = np.diff(np.unique(np.round(moments, 6)))
    assert 3 < len(moments) < 30
    assert waits[-1] > 1.5 * waits[0]


@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse", "four-pulse", deep("optimal")])
def test_coasts_take_no_steps(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With dissipation, only the pulses are integrated: a long wait between them costs nothing."""
    spans, integrate = list[float](), rigid.integrate

    def counted(*args: object, **named: object) -> object:
        spans.append(float(args[5]) - float(args[4]))  # type: ignore[arg-type]
        return integrate(*args, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(rigid, "integrate", counted)
    body = spinner(channels=jets(5.0, 3, 0.5), limits=Limits(horizon=400.0))
    assert plan(replace(body, dissipation=300.0), scheme).feasible
    assert spans
    assert max(spans) < 0.501  # the longest pulse, and a little more for difference quotients


# --- what is claimed -------------------------------------------------------------------------------------------------


@pytest.mark.deep
def test_no_bound_is_claimed_under_dissipation(run: Run, plans_shared: None) -> None:
    """An oblate body damps itself: there are schedules below A|ω0|, and they are found."""
    command = "plan", str(case("oblate-dissipation.yaml")), "--scheme", "optimal"
    shown = run(*command).stdout
    check_text("dissipation.no-bound", "\n".join(line for line in shown.splitlines() if "least impulse" in line))
    (planned,) = json.loads(run(*command, "--json", "-").stdout)["plans"]
    assert planned["total_impulse_Nms"] < 0.65 * planned["least_impulse_Nms"]


@pytest.mark.deep
@pytest.mark.parametrize(("A", "C"), [(80.0, 120.0), (120.0, 80.0)], ids=["oblate", "prolate"])
def test_the_first_order_least_knows_dissipation(A: float, C: float) -> None:
    """Small angles: with κ the optimum waits (oblate) or hurries (prolate), and costs what the program says."""
    body = spinner(A, C, degrees=0.5, channels=jets(5.0, longest=0.5), limits=Limits(horizon=60.0))
    one = plan(replace(body, dissipation=100.0), "optimal")
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
    body = replace(spinner(80.0, 120.0, channels=jets(400.0, 3), limits=Limits(horizon=600.0)), dissipation=20.0)
    one = plan(body, "optimal")
    assert one.flown is not None, infeasibility(one)
    assert one.flown.nutation < NEARLY_NOTHING
    assert all(pulse.resolved for pulse in one.pulses)
    assert one.pulses.total_impulse < 1e-3 * body.least_impulse
    assert one.pulses.bounds is not None
    assert one.pulses.bounds.within < 300.0  # the least within as long as the search looks


@spread(
    ("name", "options", "status", "said"),
    [
        ("crash-hang-near-sphere-dissipation", (), 3, r"dissipation takes the nutation out.*? optimal:"),
        ("crash-dissipation-near-sphere-overflow", (), 3, ""),
        ("crash-halfcone-trim-crash", (), 0, ""),
        ("crash-target-ideal-torquer-dissipation", ("--target", "5deg,0deg"), 0, ""),
        ("crash-dissipation-short", (), 0, r"the nutation grows.*? rough"),
    ],
    quick=2,
)
def test_files_that_went_wrong(run: Run, name: str, options: tuple[str, ...], status: int, said: str) -> None:
    """Near a sphere ω takes days to turn in the body, and dissipation minutes to take it out."""
    done = run("plan", str(case(f"{name}.yaml")), *options)
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
    assert "nan" not in done.stdout.split()
    sentence = re.search(said, " ".join(done.stdout.split()))
    assert sentence is not None
    if said:
        check_text(f"dissipation.{name.removeprefix('crash-')}", sentence.group())


def test_the_course_example_is_no_flat_spin_at_345_s() -> None:
    """By the book of a course the nutation is 45.08° then."""
    plain = spinner(2000.0, 1000.0, 2.0 * math.pi, 0.0)
    body = replace(plain, omega0=np.array([0.1, 0.0, 2.0 * math.pi]), dissipation=100.0)
    rates, _ = flight.flown(body, Schedule(), 345.0).motion(np.array([345.0]))
    nutation = math.degrees(reference.nutation(body.inertia.moments, rates[0], 1.0))
    assert nutation == pytest.approx(45.08, abs=0.005)

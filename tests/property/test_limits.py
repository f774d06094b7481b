"""Every scheme under any limits: a feasible plan keeps them all and lowers the nutation, an infeasible one says why."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.builders import channel, cross, fan, spinner, within
from support.cases import spread
from support.checker import violations

from nutdamp import planning
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.spacecraft import Channel, Limits, Spacecraft, Steerable

PATIENCE = 10_000_000
"""Calls of functions for one plan, which takes two million at most; so that an endless search fails, not hangs."""

REQUESTED = {
    "one-pulse": ("one-pulse", Options()),
    "two-pulse": ("two-pulse", Options()),
    "two-pulse, literal": ("two-pulse", Options(literal=True)),
    "four-pulse": ("four-pulse", Options()),
    "four-pulse, coarse": ("four-pulse", Options(coarse=True)),
}


def power(rng: np.random.Generator, least: float, most: float) -> float:
    """Ten to a random power."""
    return float(10 ** rng.uniform(least, most))


def channels(rng: np.random.Generator, needed: float, period: float) -> tuple[Channel, ...]:
    """One to six, of any direction, mostly transverse; on-times from a thousandth to a multiple of what is needed."""
    made = []
    for index in range(rng.integers(1, 7)):
        angle = rng.choice([0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi, rng.uniform(-math.pi, math.pi)])
        size = needed / (period * power(rng, -1.5, 0.5))
        axial = size * float(rng.choice([0.0, 0.0, 0.0, 0.05, -0.2, 1.5]))
        shortest = period * power(rng, -4.0, -1.0) if rng.random() < 0.5 else 0.0
        longest = shortest + period * power(rng, -3.0, 0.0) if rng.random() < 0.5 else math.inf
        made.append(
            channel(
                f"T{index}",
                size * math.cos(angle),
                size * math.sin(angle),
                axial,
                min_on_time=shortest,
                max_on_time=longest,
                isp=220.0 if rng.random() < 0.5 else None,
                thrust=1.0,
                force=(0.0, 0.0, 1.0),
            )
        )
    return tuple(made)


def limits(rng: np.random.Generator, period: float, horizon: float) -> Limits:
    """Each limit in about half of the cases; blackouts overlap and come in any order."""
    end = horizon if rng.random() < 0.5 else period * power(rng, -1.0, 2.0)
    reach = min(end, 10 * period)
    tick = rng.choice([1e-3, 0.01, 0.1, period * power(rng, -4.0, -0.5)])
    windows = [tuple(sorted(rng.uniform(0.0, reach, 2).tolist())) for _ in range(rng.integers(0, 4))]
    return Limits(
        horizon=None if end == horizon else end,
        earliest=end * float(rng.choice([0.0, 0.0, 0.1, rng.uniform(0.0, 0.9)])),
        gap=period * float(rng.choice([0.0, 0.0, 0.01, 0.3, 3.0])),
        tick=float(tick) if rng.random() < 0.5 else None,
        max_pulses=int(rng.integers(1, 10)) if rng.random() < 0.5 else None,
        blackout=tuple((begin, end) for begin, end in windows) if rng.random() < 0.5 else (),
    )


def random_spacecraft(rng: np.random.Generator) -> Spacecraft:
    """Prolate, oblate, sphere, nearly one, flat disc; now and then triaxial; thrusters, a torquer, or both."""
    A = power(rng, -1.0, 4.0)
    a = float(
        rng.choice([rng.uniform(-0.99, 0.95), rng.uniform(-0.99, 0.95), 0.0, -1.0, 0.25, 0.2, -1 / 3, 1e-3, -1e-9])
    )
    moments = (A, A, A * (1 - a))
    if rng.random() < 0.2 and abs(a) > 0.3 and a > -0.8:
        spread = rng.uniform(0.01, 0.15)  # still stable, and still a body
        moments = (A * (1 + spread), A * (1 - spread), A * (1 - a))
    spin = float(rng.choice([1.0, -1.0])) * power(rng, -1.0, 1.0)
    degrees = float(rng.choice([rng.uniform(0.01, 10.0), rng.uniform(1.0, 40.0)]))
    phase = float(rng.choice([0.0, 0.5 * math.pi, math.pi, rng.uniform(-math.pi, math.pi)]))
    plain = spinner(spin=spin, degrees=degrees, phase=phase, moments=moments)
    period, needed = min(plain.body_period, plain.inertial_period), plain.least_impulse
    torque = needed / (period * power(rng, -1.5, 0.5)) if rng.random() < 0.7 else None
    return spinner(
        spin=spin,
        degrees=degrees,
        phase=phase,
        moments=moments,
        channels=channels(rng, needed, period) if rng.random() < 0.8 else (),
        steerable=Steerable(torque) if rng.random() < 0.3 else None,
        limits=limits(rng, period, plain.horizon),
        mass=250.0,
    )


def check(body: Spacecraft, scheme: str, options: Options) -> None:
    with within(PATIENCE):
        plan = planning.plan(body, scheme, options)
        figures = (plan.residual, plan.flown, plan.delta_v, plan.spin_change, plan.meets_requirement)
    if not plan.feasible:
        assert infeasibility(plan)
        assert len(plan.pulses) == 0
        assert figures == (None,) * 5
        return
    assert infeasibility(plan) == ""
    assert violations(body, plan.pulses) == []
    assert len(plan.pulses) > 0
    assert plan.flown is not None
    assert plan.residual is not None
    assert plan.flown.nutation < body.nutation
    assert plan.spin_change is not None
    for left in (plan.flown, plan.residual):
        assert np.isfinite([left.nutation, left.body_cone, left.space_cone, left.momentum_shift]).all()
    axial = math.fsum(pulse.impulse[2] for pulse in plan.pulses)
    if body.inertia.symmetric:
        # After a long wait the clock tells the width of a pulse to its own rounding only.
        ticks = sum(
            abs(pulse.impulse[2]) * 4 * np.spacing(pulse.end) / pulse.on_time for pulse in plan.pulses if pulse.on_time
        )
        rounding = 1e-9 * abs(body.spin) + ticks / body.inertia.C
        assert plan.spin_change == pytest.approx(axial / body.inertia.C, abs=rounding)
    if scheme == "two-pulse":
        assert len(plan.pulses) == 2


@spread("requested", REQUESTED.values(), quick=1, deep=2, ids=REQUESTED)
@spread("block", range(10), quick=1, deep=2)
def test_whatever_the_limits(block: int, requested: tuple[str, Options]) -> None:
    """Seeds, not hypothesis: its examples change with every module that happens to be loaded."""
    for seed in range(20 * block, 20 * (block + 1)):
        body = random_spacecraft(np.random.default_rng(seed))
        try:
            check(body, *requested)
        except BaseException as failure:
            failure.add_note(f"seed {seed}: {body}")
            raise


HARD = {
    "tick as long as the horizon": Limits(tick=10.0, horizon=10.0),
    "tick longer than the horizon": Limits(tick=1e3, horizon=10.0),
    "tick of a nanosecond": Limits(tick=1e-9, earliest=1.0 / 3.0, blackout=((1.0, 2.0 / 3.0 + 1.0),)),
    "horizon too short for anything": Limits(horizon=1e-3),
    "earliest at the end": Limits(earliest=124.0),
    "earliest after the default horizon": Limits(earliest=1e9),
    "gap longer than the horizon": Limits(gap=1e6),
    "all dark": Limits(blackout=((0.0, 1e9),)),
    "hundred dark windows": Limits(blackout=tuple((0.7 * n, 0.7 * n + 0.6) for n in range(100))),
    "dark but for moments": Limits(blackout=tuple((0.7 * n, 0.7 * n + 0.69999) for n in range(1000))),
    "windows of no length": Limits(blackout=tuple((0.1 * n, 0.1 * n) for n in range(200))),
    "one pulse": Limits(max_pulses=1),
    "a year": Limits(horizon=3.2e7, gap=3600.0),
}


@spread("requested", REQUESTED.values(), quick=1, ids=REQUESTED)
@spread("hard", HARD.values(), quick=1, ids=HARD)
def test_awkward_limits(hard: Limits, requested: tuple[str, Options]) -> None:
    for actuators in (cross(20.0), cross(0.5, min_on_time=0.02, max_on_time=0.3), fan(16, 3.0)):
        check(spinner(channels=actuators, limits=hard), *requested)
    for torque in (None, 50.0, 0.5):
        if requested[0] != "four-pulse":
            check(spinner(steerable=Steerable(torque), limits=hard), *requested)


@pytest.mark.parametrize("requested", REQUESTED.values(), ids=REQUESTED)
@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1e9], ids=str)
def test_units_of_mass_do_not_matter(scale: float, requested: tuple[str, Options]) -> None:
    """Inertia and torques scaled together: the same pulses."""
    plain, scaled = (
        planning.plan(spinner(120.0 * s, 80.0 * s, channels=cross(20.0 * s)), *requested) for s in (1.0, scale)
    )
    assert scaled.feasible == plain.feasible
    assert [one.channel for one in scaled.pulses] == [one.channel for one in plain.pulses]
    for one, other in zip(plain.pulses, scaled.pulses, strict=True):
        assert other.t == pytest.approx(one.t, rel=1e-9)
        assert other.on_time == pytest.approx(one.on_time, rel=1e-9)


@pytest.mark.parametrize("requested", REQUESTED.values(), ids=REQUESTED)
@pytest.mark.parametrize("scale", [1e-6, 1e3], ids=str)
def test_units_of_time_do_not_matter(scale: float, requested: tuple[str, Options]) -> None:
    """Spin × s, torques × s²: the same pulses s times as fast."""
    plain, scaled = (
        planning.plan(spinner(spin=3.0 * s, channels=cross(20.0 * s * s)), *requested) for s in (1.0, scale)
    )
    assert [one.channel for one in scaled.pulses] == [one.channel for one in plain.pulses]
    for one, other in zip(plain.pulses, scaled.pulses, strict=True):
        assert other.t * scale == pytest.approx(one.t, rel=1e-8)
        assert other.on_time * scale == pytest.approx(one.on_time, rel=1e-8)


@pytest.mark.deep
@pytest.mark.parametrize("requested", REQUESTED.values(), ids=REQUESTED)
@spread("degrees", [1e-9, 1e-6, 1e-3, 70.0, 89.0], quick=2)
def test_nutation_from_next_to_nothing_to_next_to_a_right_angle(degrees: float, requested: tuple[str, Options]) -> None:
    for C, spin in ((40.0, 3.0), (80.0, -3.0), (120.0, 3.0), (240.0, -3.0)):
        torque = spinner(120.0, C, spin, degrees).least_impulse * 3.0
        check(spinner(120.0, C, spin, degrees, channels=cross(torque)), *requested)
        if requested[0] != "four-pulse":
            check(spinner(120.0, C, spin, degrees, steerable=Steerable(torque)), *requested)


@pytest.mark.deep
def test_many_channels() -> None:
    body = spinner(channels=fan(24, 4.0))
    for requested in REQUESTED.values():
        check(body, *requested)


@spread("requested", [REQUESTED[name] for name in ("one-pulse", "two-pulse", "two-pulse, literal")], quick=1)
@spread("torque", [30.0, 100.0], quick=1)
@spread("moments", [(120.0, 100.0, 80.0), (80.0, 70.0, 120.0)], quick=1, ids=["prolate", "oblate"])
@spread(
    "limit",
    [Limits(tick=0.01), Limits(earliest=2.0), Limits(earliest=2.0, tick=0.1), Limits(blackout=((0.0, 3.0),))],
    quick=16,
    ids=["tick", "earliest", "both", "blackout"],
)
def test_torquer_on_a_body_of_three_different_moments_keeps_the_limits(
    limit: Limits, moments: tuple[float, float, float], torque: float, requested: tuple[str, Options]
) -> None:
    """Going from the symmetric model to the body changes on-times, and must not move starts out of the limits."""
    body = spinner(moments=moments, steerable=Steerable(torque), limits=limit)
    made = planning.plan(body, *requested)
    assert made.feasible, infeasibility(made)
    assert violations(body, made.pulses) == []

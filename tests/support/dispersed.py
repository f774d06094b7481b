"""Dispersed spacecraft with schedules for the tests."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from support.builders import spinner

from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.montecarlo.inputs import BLOCK, Draws
from nutdamp.montecarlo.study import Study
from nutdamp.spacecraft.equipment import Channel, Steerable, Thruster
from nutdamp.spacecraft.model import Limits
from nutdamp.spacecraft.schedule import Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance


def normal(size: float, *, relative: bool = False) -> Tolerance:
    """A normal tolerance, absolute by default."""
    return Tolerance("normal", size, relative)


def jet(
    name: str, position: tuple[float, ...], force: tuple[float, ...], isp: float = 220.0
) -> Thruster:
    """A thruster that is known by position and force."""
    return Thruster(
        name,
        np.cross(position, force),
        np.array(force, dtype=float),
        math.hypot(*force),
        isp,
        position=np.array(position, dtype=float),
    )


JETS = (
    jet("T1", (0.0, 0.3, 0.8), (0.0, -10.0, 0.0)),
    jet("T2", (-0.3, 0.1, 0.8), (9.0, 0.5, 1.0)),  # an axial torque too
)
"""Two thrusters near the forward end; the second has a torque about every axis."""


def everything(scale: float = 1.0, names: tuple[str, ...] = ("T1", "T2")) -> Dispersions:
    """All tolerances there are, at usual sizes times ``scale``."""
    return Dispersions(
        A=normal(0.02 * scale, relative=True),
        C=normal(0.02 * scale, relative=True),
        omega0=(normal(0.002 * scale),) * 3,
        thrust=dict.fromkeys(names, normal(0.03 * scale, relative=True)),
        thrust_per_pulse=normal(0.01 * scale, relative=True),
        thrust_direction=dict.fromkeys(names, normal(0.01 * scale)),
        position=dict.fromkeys(names, normal(0.005 * scale)),
        timing=Tolerance("uniform", 0.005 * scale),
        timing_offset=Tolerance("triangular", 0.01 * scale),
        attitude=normal(0.004 * scale),
    )


def with_jets(
    *,
    moments: tuple[float, float, float] = (120.0, 120.0, 80.0),
    spin: float = 3.0,
    scale: float = 1.0,
) -> DispersedModel:
    """Three pulses of two thrusters, the last of both together, with every tolerance."""
    channels = (*(Channel(one.name, (one,)) for one in JETS), Channel("both", JETS))
    body = spinner(moments=moments, spin=spin, channels=channels)
    first, second, both = channels
    pulses = (
        channel_pulse(first, 0.9, 0.4),
        channel_pulse(second, 2.1, 0.7),
        channel_pulse(both, 3.2, 0.2),
    )
    return DispersedModel(replace(body, dispersions=everything(scale)), Schedule(pulses))


def sinking(model: DispersedModel, time_constant: float = 15.0) -> DispersedModel:
    """The same with energy dissipation."""
    return DispersedModel(replace(model.spacecraft, dissipation=time_constant), model.schedule)


def wheeled(model: DispersedModel, wheel: float, *, spin: float | None = None) -> DispersedModel:
    """The same with a wheel whose momentum (N m s) is dispersed, and another ``spin`` (rad/s)."""
    body = model.spacecraft
    given = model.spacecraft.dispersions or Dispersions()
    rates = body.omega0 if spin is None else np.array([*body.omega0[:2], spin])
    held = replace(
        body,
        inertia=replace(body.inertia, wheel=wheel),
        omega0=rates,
        nutation_grows=True,
        dispersions=replace(given, wheel_momentum=normal(4.0)),
    )
    return DispersedModel(held, model.schedule)


def steered(
    *,
    moments: tuple[float, float, float] = (120.0, 120.0, 80.0),
    spin: float = 3.0,
    scale: float = 1.0,
) -> DispersedModel:
    """Two pulses of a steerable torquer, one of them early, and an ideal impulse."""
    torquer = Steerable(20.0, 220.0, 0.8)
    body = spinner(moments=moments, spin=spin, steerable=torquer)
    pulses = (
        steerable_pulse(torquer, 0.3, 0.4, on_time=0.4),
        steerable_pulse(torquer, 1.9, -2.0, on_time=0.3),
        replace(steerable_pulse(Steerable(), 1.92, 1.0, impulse=3.0), channel="steerable"),
    )
    tolerances = everything(scale, ("steerable",))
    return DispersedModel(replace(body, dispersions=tolerances), Schedule(pulses))


def exact_two_pulse(scale: float, **tolerances: object) -> Study:
    """The exact two-pulse by ideal impulses, which leaves nothing, dispersed a little."""
    from nutdamp.planning import plan as planning

    body = spinner(limits=Limits(earliest=1.0))  # a pulse at t = 0 could only be late
    plan = planning.plan(body, "two-pulse")
    requested = replace(everything(scale, ("steerable",)), **tolerances)  # type: ignore[arg-type]
    return Study(DispersedModel(replace(body, dispersions=requested), plan.pulses), seed=11)


def tensors(model: DispersedModel, size: float = 0.01) -> DispersedModel:
    """The model with all entries of its inertia tensor dispersed in place of A and C."""
    spread = replace(
        model.spacecraft.dispersions or Dispersions(),
        A=None,
        C=None,
        wheel_momentum=None,
        correlation=(),
        inertia_tensor=normal(size, relative=True),
    )
    return DispersedModel(replace(model.spacecraft, dispersions=spread), model.schedule)


def first_cases(study: Study, count: int) -> dict[str, np.ndarray]:
    """Draws of the first cases, by input, (n,)."""
    assert count <= BLOCK
    draws, _ = study.source().block(0)
    return {name: np.array(np.broadcast_to(draw, BLOCK)[:count]) for name, draw in draws.items()}


def one_of(draws: Draws | Mapping[str, np.ndarray], case: int) -> dict[str, float]:
    """The deviations of one case."""
    return {name: float(np.asarray(draw)[case]) for name, draw in draws.items()}


FILE = """\
name: Dispersed
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 30 rpm, nutation: 5 deg, phase: 40 deg}
steerable: {torque: 60 N m, isp: 220 s, lever_arm: 1 m}
limits: {earliest: 1 s}
requirement: {nutation: 0.6 deg, momentum_shift: 0.4 deg, probability: 60 %}
dispersions:
  A: {normal: 1 %}
  C: {normal: 1 %}
  omega0: {normal: 0.1 deg/s}
  thrust: {normal: 3 %}
  thrust_per_pulse: {normal: 1 %}
  thrust_direction: {normal: 0.5 deg}
  timing: {uniform: 5 ms}
  timing_offset: {bias: 2 ms}
  position: {normal: 5 mm}
  attitude: {normal: 0.2 deg}
"""
"""A spacecraft file with most kinds of dispersions."""

"""Faults planted in the planner's physics: `verify` reports each,
since it flies by the file alone.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import pytest

from nutdamp.files import reader
from nutdamp.flight.verification import Verification, verify
from nutdamp.physics import attitude, body, response
from nutdamp.physics.thruster import Trapezoid
from nutdamp.planning.plan import plan
from nutdamp.spacecraft.equipment import Channel, Thruster
from nutdamp.spacecraft.model import Inertia, Spacecraft

JETS = """
name: Planted
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 3 rad/s, nutation: 4 deg, phase: 40 deg}
attitude: {quaternion: [0.8, 0.36, 0.48, 0]}
center_of_mass: [0, 0, 0.1 m]
thrusters:
  - {name: +M1, position: [0, 0, 0.9], direction: [0, -1, 0], force: 10 N, isp: 220 s}
  - {name: -M1, position: [0, 0, 0.9], direction: [0, 1, 0], force: 10 N, isp: 220 s}
  - {name: +M2, position: [0, 0, 0.9], direction: [1, 0, 0], force: 10 N, isp: 220 s}
  - {name: -M2, position: [0, 0, 0.9], direction: [-1, 0, 0], force: 10 N, isp: 220 s}
"""
VALVE = (
    f"{JETS}valve: {{open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}}\n"
)
WHEEL = f"{JETS}wheel: {{momentum: 40 N m s}}\n"
DAMPER = f"{JETS}dissipation: {{time_constant: 600 s}}\n"
LEAK = f"{JETS}disturbances: [{{torque: [20 mN m, 0, 0], fixed_in: inertial}}]\n"
BURN = f"{JETS}disturbances: [{{torque: [2 N m, 1 N m, 0], from: 1 s, until: 20 s}}]\n"

Plant = Callable[[pytest.MonkeyPatch], None]


def after(owner: Any, name: str, changed: Callable[[Any], Any]) -> Plant:
    """A function of a module or class, whose result is ``changed``."""
    usual = getattr(owner, name)
    return lambda patch: patch.setattr(owner, name, lambda *parts: changed(usual(*parts)))


def off_center(patch: pytest.MonkeyPatch) -> None:
    read = reader._thruster
    patch.setattr(
        reader, "_thruster", lambda entry, axes, valve, center: read(entry, axes, valve, -center)
    )


def valve(changed: Callable[[Trapezoid], Trapezoid], late: float = 0.0) -> Plant:
    responds = Trapezoid.thrust

    def thrust(self: Trapezoid, on_time: float) -> Any:
        usual = responds(changed(self), on_time)
        ramps = tuple(
            ramp._replace(begin=ramp.begin + late, end=ramp.end + late) for ramp in usual.ramps
        )
        return usual._replace(centroid=usual.centroid + late, ramps=ramps)

    return lambda patch: patch.setattr(Trapezoid, "thrust", thrust)


def scaled(owner: type, name: str, factor: float) -> Plant:
    kept = vars(owner)[name]
    usual = kept.func if isinstance(kept, cached_property) else kept.fget
    return lambda patch: patch.setattr(owner, name, property(lambda self: factor * usual(self)))


def inertia(first: float, wheel: float) -> Plant:
    def faulty(moments: tuple[float, float, float], axes: Any, momentum: float) -> Inertia:
        return Inertia((first * moments[0], first * moments[1], moments[2]), axes, wheel * momentum)

    return lambda patch: patch.setattr(reader, "Inertia", faulty)


FAULTS: dict[str, tuple[str, Plant]] = {
    "center of mass added": (JETS, off_center),
    "cross product swapped": (
        JETS,
        after(reader, "_thruster", lambda jet: replace(jet, torque=-jet.torque)),
    ),
    "sign of a delay": (VALVE, valve(lambda one: replace(one, open_delay=-one.open_delay))),
    "torque x 1.02": (JETS, scaled(Channel, "torque", 1.02)),
    "sign of the wheel in H": (WHEEL, inertia(1.0, -1.0)),
    "time constant x 1.1": (DAMPER, scaled(Spacecraft, "growth", 1.0 / 1.1)),
    "mass flow x 2": (JETS, scaled(Thruster, "mass_flow", 2.0)),
    "sign of fixed_in": (
        LEAK,
        after(reader, "_disturbance", lambda one: replace(one, rate=-one.rate)),
    ),
    "until 1 ms later": (
        BURN,
        after(reader, "_disturbance", lambda one: replace(one, end=one.end + 1e-3)),
    ),
    "nutation x 0.9": (
        JETS,
        after(body, "momentary", lambda it: it._replace(nutation=0.9 * it.nutation)),
    ),
    "width factor 1": (JETS, after(response, "width_factor", lambda _: 1.0)),
    "force x 1.02": (JETS, after(reader, "force_vector", lambda force: 1.02 * force)),
    "isp x 1.02": (JETS, after(reader, "_thruster", lambda jet: replace(jet, isp=1.02 * jet.isp))),
    "thrust 1 ms late": (VALVE, valve(lambda one: one, late=0.001)),
    "A x 1.01": (JETS, inertia(1.01, 1.0)),
    "quaternion of the frame to the body": (
        JETS,
        after(
            reader,
            "_attitude",
            lambda it: replace(it, quaternion=attitude.conjugate(it.quaternion)),
        ),
    ),
}


def verified(text: str) -> Verification:
    spacecraft = reader.read_spacecraft(text, "f.yaml")
    return verify(spacecraft, plan(spacecraft, "four-pulse").pulses)


@pytest.mark.weekly
@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_reported(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nutdamp.flight.verification.SAMPLES", 21)
    text, plant = FAULTS[name]
    assert verified(text).agree
    plant(monkeypatch)
    faulty = verified(text)
    assert "DOP853" in faulty.checks
    assert not faulty.agree
    assert faulty.disagreeing == (
        ("impulse sum (17)",) if name == "width factor 1" else ("DOP853",)
    )

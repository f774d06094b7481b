"""What a dispersed case is, against vector algebra written out for single cases, and what of it is drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import dispersed
from support.builders import channel, spinner
from support.golden import check_text

from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.elementwise import rotated, tilt_axes
from nutdamp.dispersion.inputs import list_inputs
from nutdamp.physics.inertia import principal_axes
from nutdamp.schedule import Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft import Channel, Inertia, Steerable
from nutdamp.tolerances import Dispersions, Tolerance


def test_a_tilted_and_moved_force_gives_its_torque() -> None:
    """(r + δr) × (Rot(tilt) F) times both factors and the on-time, each thruster of the channel with its own."""
    model = dispersed.with_jets()
    draws = {
        "thrust T1": 0.1, "thrust T2": -0.05, "thrust pulse 3": 0.02,
        "direction T1 a": 0.2, "direction T1 b": -0.1, "direction T2 b": 0.3,
        "position T1 x": 0.01, "position T1 z": -0.02, "position T2 y": 0.03,
    }  # fmt: skip
    torque, flow = np.zeros(3), 0.0
    for jet in dispersed.JETS:
        assert jet.force is not None
        assert jet.position is not None
        assert jet.mass_flow is not None
        sizes = (draws.get(f"direction {jet.name} {axis}", 0.0) for axis in "ab")
        tilt = sum((size * axis for size, axis in zip(sizes, tilt_axes(jet.force), strict=True)), np.zeros(3))
        arm = jet.position + [draws.get(f"position {jet.name} {axis}", 0.0) for axis in "xyz"]
        factor = (1.0 + draws[f"thrust {jet.name}"]) * 1.02
        torque += factor * np.cross(arm, Rotation.from_rotvec(tilt).apply(jet.force))
        flow += factor * jet.mass_flow
    *others, both = model.schedule
    cases = model.cases(draws)
    assert np.array(cases.impulses[2]) == pytest.approx(torque * both.on_time, rel=1e-13)
    used = sum((one.propellant or np.nan) * (1.0 + draws[f"thrust {one.channel}"]) for one in others)
    assert cases.propellant == pytest.approx(flow * both.on_time + used, rel=1e-13)


def test_tilt_axes_are_square_to_the_force_and_to_each_other() -> None:
    for force in (np.array([0.0, 0.0, 5.0]), np.array([3.0, -4.0, 12.0])):
        axes = np.array([*tilt_axes(force), force / np.linalg.norm(force)])
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-15)


def test_a_steerable_pulse_is_turned_in_the_1_2_plane() -> None:
    torquer = Steerable(20.0, 220.0, 0.8)
    made = Schedule((steerable_pulse(torquer, 1.0, 0.4, on_time=0.5),))
    cases = Model(spinner(steerable=torquer), made).cases(
        {"thrust steerable": 0.1, "thrust pulse 1": 0.01, "direction steerable": 0.3}
    )
    size = 10.0 * 1.1 * 1.01
    assert np.array(cases.impulses[0]) == pytest.approx([size * np.cos(0.7), size * np.sin(0.7), 0.0])
    assert made.propellant is not None
    assert cases.propellant == pytest.approx(made.propellant * 1.1 * 1.01)


def test_a_pulse_that_the_file_does_not_explain_keeps_its_impulse() -> None:
    """A schedule file may give a channel another torque: thrust scales what it gives, tilts come on top."""
    body = spinner(channels=(channel("T1", 8.0, 0.0, 0.0, isp=200.0, thrust=10.0),))
    pulse = replace(channel_pulse(body.channels[0], 1.0, 0.5), impulse=np.array([3.0, 1.0, 0.0]))
    unknown = replace(pulse, channel="elsewhere", propellant=None)
    for fired, name in ((pulse, "thrust T1"), (unknown, "thrust pulse 1")):
        cases = Model(body, Schedule((fired,))).cases({name: 0.1})
        assert np.array(cases.impulses[0]) == pytest.approx([3.3, 1.1, 0.0])
        assert (cases.propellant is None) == (fired is unknown)


def test_rates_and_positions_are_in_the_axes_of_the_file() -> None:
    moments, axes = principal_axes(np.array([[120.0, 3.0, 0.0], [3.0, 110.0, 2.0], [0.0, 2.0, 80.0]]))
    jet = dispersed.jet("T1", (0.1, 0.3, 0.8), (0.0, -10.0, 1.0))  # in principal axes
    body = replace(spinner(moments=moments, channels=(Channel("T1", (jet,)),)), inertia=Inertia(moments, axes))
    model = Model(body, Schedule((channel_pulse(body.channels[0], 1.0, 0.5),)))
    cases = model.cases({"omega0_1": 0.01, "omega0_3": 0.02, "position T1 y": 0.05, "A": 0.01 * body.inertia.A})
    assert np.array(cases.omega0) == pytest.approx(body.omega0 + axes.T @ [0.01, 0.0, 0.02])
    more = 0.5 * np.cross(axes.T @ [0.0, 0.05, 0.0], [0.0, -10.0, 1.0])
    assert np.array(cases.impulses[0]) == pytest.approx(0.5 * jet.torque + more)
    # A scales both transverse moments, and is their mean.
    assert np.array(cases.moments) == pytest.approx([1.01 * moments[0], 1.01 * moments[1], moments[2]])
    assert float(cases.A) == pytest.approx(0.505 * (moments[0] + moments[1]))  # type: ignore[arg-type]


def test_the_attitude_is_off_by_a_rotation_vector() -> None:
    vector = (np.array([1.0, 0.2]), np.array([-0.3, 0.5]), np.array([2.0, 3.0]))
    tilt = (np.array([0.3, 0.0]), np.array([-0.4, 0.7]))
    expected = Rotation.from_rotvec(np.column_stack([*tilt, np.zeros(2)])).apply(np.column_stack(vector))
    assert np.column_stack(rotated(vector, tilt)) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(
    ("moments", "name", "off", "physical"),
    [
        ((100.0, 100.0, 180.0), "A", [0.0, -9.9, -10.1, -101.0], [True, True, False, False]),
        ((100.0, 100.0, 180.0), "thrust T1", [0.0, -1.0, -1.01], [True, True, False]),
        ((100.0, 100.0, 180.0), "timing offset", [-3.0], True),
        ((10.0, 100.0, 95.0), "C", [0.0, -6.0, 16.0], [True, False, False]),
        ((50.0, 50.0, 100.0), "C", [0.0, 1e-6], [True, False]),  # the flat disc itself can be
    ],
)
def test_bodies_and_thrusts_that_cannot_be_are_told(
    moments: tuple[float, float, float], name: str, off: list[float], physical: object
) -> None:
    assert np.asarray(dispersed.with_jets(moments=moments).physical({name: np.array(off)})).tolist() == physical


def test_every_tolerance_is_drawn_or_listed_as_unused() -> None:
    inputs = dispersed.with_jets().inputs
    names = {entry.name for entry in inputs.drawn}
    assert len(names) == len(inputs.drawn) == 5 + 2 + 3 + 4 + 6 + 3 + 1 + 2
    assert not inputs.unused
    assert {"A", "omega0_1", "thrust T1", "thrust pulse 2", "direction T1 a", "position T1 x"} < names
    assert {"timing pulse 1", "timing offset", "attitude x"} < names


def test_what_touches_nothing_is_unused_with_its_reason() -> None:
    """Idle thrusters, thrusters known by torque, sizes of zero, a torquer that gives a torque wherever it sits."""
    tolerance, torquer = Tolerance("normal", 0.01), Steerable(20.0)
    by_torque = spinner(degrees=0.0, channels=(channel("T1", 8.0, 0.0, 0.0), channel("T2", 0.0, 8.0, 0.0)))
    of_jets = Dispersions(
        C=Tolerance("normal", 0.0),
        omega0=(Tolerance("normal", 0.1, True), None, None),
        thrust={"T1": tolerance, "T2": tolerance},
        thrust_direction={"T1": tolerance},
        position={"T1": tolerance},
        timing=tolerance,
    )
    of_torquer = Dispersions(thrust_direction={"steerable": tolerance}, position={"steerable": tolerance})
    late = replace(of_torquer, timing=tolerance, timing_offset=tolerance)
    by_jet, by_torquer = channel_pulse(by_torque.channels[0], 1.0, 0.5), steerable_pulse(torquer, 1.0, 0.3, on_time=0.2)
    reasons = []
    for body, requested, pulses, expected in (
        (by_torque, of_jets, (by_jet,), ["thrust T1", "timing pulse 1"]),
        (spinner(steerable=torquer), of_torquer, (by_torquer,), ["direction steerable"]),
        (spinner(steerable=torquer), late, (), []),
    ):
        inputs = list_inputs(replace(body, dispersions=requested), Schedule(pulses))
        assert [entry.name for entry in inputs.drawn] == expected
        reasons += [f"{name}: {reason}" for name, reason in inputs.unused]
    check_text("montecarlo.unused-inputs", "\n".join(reasons))


def test_relative_sizes_are_shares_of_the_nominal_value() -> None:
    requested = Dispersions(A=Tolerance("normal", 0.02, True), omega0=(None, None, Tolerance("bias", 0.01, True)))
    inputs = list_inputs(replace(spinner(A=120.0, spin=-3.0), dispersions=requested), Schedule())
    sizes = {entry.name: (entry.size, entry.sigma) for entry in inputs.drawn}
    assert sizes == {"A": pytest.approx((2.4, 2.4)), "omega0_3": pytest.approx((-0.03, 0.0))}

"""What a dispersed case is, against vector algebra written out for single cases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import dispersed
from support.builders import channel, spinner

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
    expected = np.zeros(3)
    used = 0.0
    for jet in dispersed.JETS:
        assert jet.force is not None
        assert jet.position is not None
        assert jet.mass_flow is not None
        first, second = tilt_axes(jet.force)
        tilt = draws.get(f"direction {jet.name} a", 0.0) * first + draws.get(f"direction {jet.name} b", 0.0) * second
        force = Rotation.from_rotvec(tilt).apply(jet.force)
        arm = jet.position + [draws.get(f"position {jet.name} {axis}", 0.0) for axis in "xyz"]
        factor = (1.0 + draws[f"thrust {jet.name}"]) * 1.02
        expected += factor * np.cross(arm, force)
        used += factor * jet.mass_flow
    pulse = model.schedule.pulses[2]
    cases = model.cases(draws)
    assert np.array(cases.impulses[2]) == pytest.approx(expected * pulse.on_time, rel=1e-13)
    others = sum(
        p.propellant * (1.0 + draws[f"thrust {p.channel}"])
        for p in model.schedule.pulses[:2]
        if p.propellant is not None
    )
    assert cases.propellant == pytest.approx(used * pulse.on_time + others, rel=1e-13)


def test_tilt_axes_are_square_to_the_force_and_to_each_other() -> None:
    for force in (np.array([0.0, 0.0, 5.0]), np.array([3.0, -4.0, 12.0])):
        first, second = tilt_axes(force)
        axes = np.array([first, second, force / np.linalg.norm(force)])
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-15)


def test_a_steerable_pulse_is_turned_in_the_1_2_plane() -> None:
    torquer = Steerable(20.0, 220.0, 0.8)
    body = spinner(steerable=torquer)
    pulses = Schedule((steerable_pulse(torquer, 1.0, 0.4, on_time=0.5),))
    cases = Model(body, pulses).cases({"thrust steerable": 0.1, "thrust pulse 1": 0.01, "direction steerable": 0.3})
    size = 10.0 * 1.1 * 1.01
    assert np.array(cases.impulses[0]) == pytest.approx([size * np.cos(0.7), size * np.sin(0.7), 0.0])
    assert pulses.propellant is not None
    assert cases.propellant == pytest.approx(pulses.propellant * 1.1 * 1.01)


def test_a_pulse_that_the_file_does_not_explain_keeps_its_impulse() -> None:
    """A schedule file may give a channel another torque: thrust scales what it gives, tilts come on top."""
    body = spinner(channels=(channel("T1", 8.0, 0.0, 0.0, isp=200.0, thrust=10.0),))
    pulse = replace(channel_pulse(body.channels[0], 1.0, 0.5), impulse=np.array([3.0, 1.0, 0.0]))
    cases = Model(body, Schedule((pulse,))).cases({"thrust T1": 0.1})
    assert np.array(cases.impulses[0]) == pytest.approx([3.3, 1.1, 0.0])
    unknown = replace(pulse, channel="elsewhere", propellant=None)
    cases = Model(body, Schedule((unknown,))).cases({"thrust pulse 1": 0.1})
    assert np.array(cases.impulses[0]) == pytest.approx([3.3, 1.1, 0.0])
    assert cases.propellant is None


def test_rates_and_positions_are_in_the_axes_of_the_file() -> None:
    tensor = np.array([[120.0, 3.0, 0.0], [3.0, 110.0, 2.0], [0.0, 2.0, 80.0]])
    moments, axes = principal_axes(tensor)
    jet = dispersed.jet("T1", (0.1, 0.3, 0.8), (0.0, -10.0, 1.0))  # in principal axes
    body = replace(spinner(moments=moments, channels=(Channel("T1", (jet,)),)), inertia=Inertia(moments, axes))
    model = Model(body, Schedule((channel_pulse(body.channels[0], 1.0, 0.5),)))
    cases = model.cases({"omega0_1": 0.01, "omega0_3": 0.02, "position T1 y": 0.05, "A": 0.01 * body.inertia.A})
    assert np.array(cases.omega0) == pytest.approx(body.omega0 + axes.T @ [0.01, 0.0, 0.02])
    more = 0.5 * np.cross(axes.T @ [0.0, 0.05, 0.0], [0.0, -10.0, 1.0])
    assert np.array(cases.impulses[0]) == pytest.approx(0.5 * jet.torque + more)
    # A scales both transverse moments.
    assert np.array(cases.moments) == pytest.approx([1.01 * moments[0], 1.01 * moments[1], moments[2]])


def test_the_attitude_is_off_by_a_rotation_vector() -> None:
    vector = (np.array([1.0, 0.2]), np.array([-0.3, 0.5]), np.array([2.0, 3.0]))
    tilt = (np.array([0.3, 0.0]), np.array([-0.4, 0.7]))
    turned = np.column_stack(rotated(vector, tilt))
    expected = Rotation.from_rotvec(np.column_stack([*tilt, np.zeros(2)])).apply(np.column_stack(vector))
    assert turned == pytest.approx(expected, abs=1e-14)


def test_bodies_and_thrusts_that_cannot_be_are_reported() -> None:
    model = dispersed.with_jets(moments=(100.0, 100.0, 180.0))
    moments = model.physical({"A": np.array([0.0, -9.9, -10.1, -101.0]), "C": 0.0})
    assert np.asarray(moments).tolist() == [True, True, False, False]
    thrusts = model.physical({"thrust T1": np.array([0.0, -1.0, -1.01])})
    assert np.asarray(thrusts).tolist() == [True, True, False]
    assert model.physical({"timing offset": -3.0}) is True
    slim = Model(spinner(moments=(10.0, 100.0, 95.0)), Schedule())
    assert np.asarray(slim.physical({"C": np.array([0.0, -6.0, 16.0])})).tolist() == [True, False, False]


def test_the_flat_disc_itself_is_physical() -> None:
    model = Model(spinner(A=50.0, C=100.0), Schedule())
    assert np.asarray(model.physical({"C": np.array([0.0, 1e-6])})).tolist() == [True, False]


def test_every_tolerance_is_drawn_or_listed_as_unused() -> None:
    model = dispersed.with_jets()
    names = [entry.name for entry in model.inputs.drawn]
    assert len(names) == len(set(names)) == 5 + 2 + 3 + 4 + 6 + 3 + 1 + 2
    assert not model.inputs.unused
    assert {"A", "omega0_1", "thrust T1", "thrust pulse 2", "direction T1 a", "position T1 x"} < set(names)
    assert {"timing pulse 1", "timing offset", "attitude x"} < set(names)


def test_what_touches_nothing_is_unused_with_its_reason() -> None:
    """Idle thrusters, thrusters known by torque, sizes of zero, a torquer that gives a torque wherever it sits."""
    body = spinner(degrees=0.0, channels=(channel("T1", 8.0, 0.0, 0.0), channel("T2", 0.0, 8.0, 0.0)))
    tolerance, nothing = Tolerance("normal", 0.01), Tolerance("normal", 0.0)
    requested = Dispersions(
        C=nothing,
        omega0=(Tolerance("normal", 0.1, True), None, None),
        thrust={"T1": tolerance, "T2": tolerance},
        thrust_direction={"T1": tolerance},
        position={"T1": tolerance},
        timing=tolerance,
    )
    fired = Schedule((channel_pulse(body.channels[0], 1.0, 0.5),))
    found = list_inputs(replace(body, dispersions=requested), fired)
    assert [entry.name for entry in found.drawn] == ["thrust T1", "timing pulse 1"]
    because = dict(found.unused)
    assert because["thrust T2"] == "the schedule does not fire T2"
    assert "only its torque" in because["direction T1"]
    assert "only its torque" in because["position T1"]
    assert because["C"] == "its size is zero"
    assert because["omega0_1"] == "given in % of a value that is zero"

    torquer = spinner(steerable=Steerable(20.0))
    steered = Schedule((steerable_pulse(Steerable(20.0), 1.0, 0.3, on_time=0.2),))
    requested = Dispersions(thrust_direction={"steerable": tolerance}, position={"steerable": tolerance})
    found = list_inputs(replace(torquer, dispersions=requested), steered)
    assert [entry.name for entry in found.drawn] == ["direction steerable"]
    assert [name for name, _ in found.unused] == ["position steerable"]
    idle = list_inputs(
        replace(torquer, dispersions=replace(requested, timing=tolerance, timing_offset=tolerance)), Schedule()
    )
    assert not idle.drawn
    assert {name for name, _ in idle.unused} == {"direction steerable", "position steerable", "timing", "timing offset"}


def test_relative_sizes_are_shares_of_the_nominal_value() -> None:
    body = spinner(A=120.0, C=80.0, spin=-3.0)
    requested = Dispersions(A=Tolerance("normal", 0.02, True), omega0=(None, None, Tolerance("bias", 0.01, True)))
    drawn = {entry.name: entry for entry in list_inputs(replace(body, dispersions=requested), Schedule()).drawn}
    assert drawn["A"].size == pytest.approx(2.4)
    assert drawn["A"].sigma == pytest.approx(2.4)
    assert drawn["omega0_3"].size == pytest.approx(-0.03)
    assert drawn["omega0_3"].sigma == 0.0

"""What pictures are made of: cones that touch and roll, angles on the sky,
stretches of the track.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support import reference
from support.builders import cross, spinner
from support.golden import check_text

import nutdamp
from nutdamp.figures import geometry
from nutdamp.flight import propagation
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Attitude, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule

pytestmark = pytest.mark.usefixtures("plans_shared")

BODIES = {
    "prolate": spinner(120, 80, 3.0, 20.0, channels=cross(20.0)),
    "prolate, reversed": spinner(120, 80, -3.0, 20.0, channels=cross(20.0)),
    "oblate": spinner(80, 120, 3.0, 20.0, channels=cross(20.0)),
    "oblate, reversed": spinner(80, 120, -3.0, 20.0, channels=cross(20.0)),
    "needle": spinner(239, 6, 4.0, 60.0, channels=cross(20.0)),
    "disc": spinner(100, 200, 4.0, 40.0, channels=cross(200.0)),
    "tiny": spinner(120, 80, 3.0, 0.01, channels=cross(1.0)),
    "sphere": spinner(100, 100, 3.0, 20.0, steerable=Steerable(50.0)),
}


def flown(
    body: Spacecraft, scheme: str = "four-pulse", samples: int = 200
) -> tuple[propagation.Flight, propagation.Track]:
    pulses = planning.plan(body, scheme).pulses
    end = pulses.end + body.inertial_period
    made = propagation.flown(body, pulses, end)
    return made, made.sampled(samples, end)


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_the_cones_touch_along_the_rotation_vector_at_every_moment(body: Spacecraft) -> None:
    """Whether thrusters are on or not; the half-angles are those of the track."""
    made, track = flown(body, "one-pulse" if body.steerable else "four-pulse")
    for row in range(0, len(track.t), 7):
        found = geometry.cones(made, track.rates[row], track.quaternion[row])
        assert attitude.angle_between(found.axis, track.axis[row]) < 1e-12
        for rim, middle, half in (
            (found.body, found.axis, track.body_cone[row]),
            (found.space, found.momentum, abs(track.space_cone[row])),
        ):
            if len(rim) == 0:
                assert half <= 2 * geometry.NO_CONE
                continue
            assert attitude.angle_between(rim, middle) == pytest.approx(half, abs=1e-12)
            assert attitude.angle_between(rim, found.rotation).min() < 1e-12
            assert np.array_equal(rim[0].round(12), rim[-1].round(12))


@pytest.mark.parametrize(
    "name", ["prolate", "prolate, reversed", "needle", "tiny", "oblate", "oblate, reversed", "disc"]
)
def test_a_body_cone_rolls_outside_the_space_cone_or_about_that_of_an_oblate_body(
    name: str,
) -> None:
    made, track = flown(BODIES[name])
    cones = geometry.cones(made, track.rates[0], track.quaternion[0])
    if made.spacecraft.inertia.A > made.spacecraft.inertia.C:
        assert (
            attitude.angle_between(cones.body, cones.momentum) >= track.space_cone[0] - 1e-12
        ).all()
        assert attitude.angle_between(cones.axis, cones.momentum) > abs(track.space_cone[0])
    else:
        assert (attitude.angle_between(cones.space, cones.axis) <= track.body_cone[0] + 1e-12).all()
        assert track.body_cone[0] > track.nutation[0]


@pytest.mark.parametrize(
    "moments", [(120.0, 120.0, 80.0), (120.0, 100.0, 80.0), (80.0, 90.0, 120.0)]
)
@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_the_cones_at_one_moment_foretell_the_motion(
    moments: tuple[float, float, float], spin: float
) -> None:
    """The reference integrator's ω runs along the space cone in space, and along the body cone in
    the body.
    """
    body = spinner(moments=moments, spin=spin, degrees=25.0)
    made = propagation.flown(body, Schedule(), 1.0)
    start = body.initial
    found = geometry.cones(made, start.rates, start.quaternion)
    back = attitude.matrix(start.quaternion).T
    for until in (0.4, 1.3):
        motion = reference.fly(moments, body.omega0, [], until, attitude.matrix(start.quaternion))
        unit = motion.rates / np.linalg.norm(motion.rates)
        spacing = 2 * math.pi / geometry.RIM
        assert attitude.angle_between(found.space, motion.rotation @ unit).min() < spacing * 0.5
        assert attitude.angle_between(found.body @ back.T, unit).min() < spacing * 0.5


@pytest.mark.parametrize(
    "body", [BODIES["prolate"], BODIES["oblate, reversed"], spinner(moments=(120, 100, 80))]
)
def test_the_mark_stays_where_it_is_in_the_body(body: Spacecraft) -> None:
    made = propagation.flown(body, Schedule(), 4.0)
    track = made.sampled(20, 4.0)
    marks = [
        attitude.matrix(quaternion).T
        @ geometry.body_mark(geometry.cones(made, rates, quaternion), quaternion)
        for rates, quaternion in zip(track.rates, track.quaternion, strict=True)
    ]
    assert np.ptp(marks, axis=0) == pytest.approx(0.0, abs=1e-3)
    assert marks[0][1] == pytest.approx(0.0, abs=1e-3)
    assert marks[0][0] > 0.0


@pytest.mark.parametrize("wheel", [0.0, 42.0])
def test_without_nutation_there_are_no_cones(wheel: float) -> None:
    """With a wheel: H is that of it, and there is no ω to have a direction."""
    body = spinner(degrees=0.0)
    if wheel:
        body = replace(body, inertia=replace(body.inertia, wheel=wheel), omega0=np.zeros(3))
    found = geometry.cones(
        propagation.flown(body, Schedule(), 1.0), body.omega0, body.initial.quaternion
    )
    assert len(found.body) == len(found.space) == 0
    assert found.rotation == pytest.approx(found.momentum)
    assert np.isnan(geometry.body_mark(found, body.initial.quaternion)).all()


# --- the sky
# --------------------------------------------------------------------------------------------------


def test_in_n_the_spin_axis_begins_to_the_right_and_turns_as_seen_against_h() -> None:
    """Both spins: H points at the viewer, so that the axis always goes round to the left."""
    for spin in (3.0, -3.0):
        made, track = flown(spinner(spin=spin, degrees=5.0), "none")
        path, momentum, _ = geometry.sky_paths(made, track)
        assert path[0] == pytest.approx([5.0, 0.0], abs=1e-9)
        assert path[3][1] > 0.0
        assert momentum == pytest.approx(np.zeros_like(momentum), abs=1e-9)


def test_in_a_celestial_frame_east_is_right_and_north_is_up() -> None:
    """H along x, right ascension and declination zero: east is y, north is z."""
    up = Attitude(attitude.from_matrix(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])))
    made = propagation.flown(spinner(degrees=0.0, attitude=up), Schedule(), 1.0)
    plane = geometry.sky_plane(made, np.array([240.0, 0.0, 0.0]))
    seen = geometry.on_sky(plane, np.array([[1.0, math.tan(0.1), 0.0], [1.0, 0.0, math.tan(0.2)]]))
    assert seen == pytest.approx(np.degrees([[0.1, 0.0], [0.0, 0.2]]))
    check_text("pictures.sky", "\n".join(geometry.sky_names(made)))


@pytest.mark.parametrize(
    "momentum", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.3, -0.5, 0.2)]
)
def test_the_sky_is_right_handed_everywhere(momentum: tuple[float, float, float]) -> None:
    made = propagation.flown(spinner(attitude=Attitude(np.array([1.0, 0, 0, 0]))), Schedule(), 1.0)
    plane = geometry.sky_plane(made, np.array(momentum))
    assert plane @ plane.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(plane) == pytest.approx(1.0)


def test_distances_from_h_are_angles() -> None:
    made, track = flown(BODIES["disc"])
    path, _, _ = geometry.sky_paths(made, track)
    assert np.hypot(*path.T) == pytest.approx(
        np.degrees(attitude.angle_between(track.axis, track.momentum[0])), abs=1e-9
    )


def test_angles_on_the_sky_are_directions_and_back() -> None:
    made, track = flown(BODIES["disc"])
    plane = geometry.sky_plane(made, track.momentum[0])
    angles = np.array([[0.0, 0.0], [3.0, -4.0], [-60.0, 80.0], [1e-9, 0.0], [0.0, 179.0]])
    directions = geometry.off_sky(plane, angles)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(len(angles)))
    assert geometry.on_sky(plane, directions) == pytest.approx(angles, abs=1e-9)


# --- rows
# --------------------------------------------------------------------------------------------------


def turned(points: Vector) -> float:
    """Largest angle in rad between neighbouring rows of the pole curve, where nothing fires."""
    plain = points[:, 0] + 1j * points[:, 1]
    return float(np.abs(np.angle(plain[1:] * plain[:-1].conj())).max())


@pytest.mark.parametrize("samples", [2, 50])
def test_a_coarse_track_is_drawn_finely(samples: int) -> None:
    made = propagation.flown(spinner(), Schedule(), 300.0)
    fine = geometry.drawn(made, made.sampled(samples, 300.0))
    assert fine.t[-1] == 300.0
    assert turned(np.degrees(fine.rates[:, :2])) < 2 * math.pi / geometry.ROWS_A_TURN * 1.01
    assert geometry.drawn(made, fine) is fine


def test_of_a_very_long_time_the_first_part_is_drawn_and_all_pulses() -> None:
    made = propagation.flown(
        spinner(), Schedule((Pulse(5000.0, 0.0, "x", np.array([1.0, 0, 0])),)), 1e6
    )
    fine = geometry.drawn(made, made.sampled(1000, 1e6))
    assert len(fine.t) < geometry.MOST_ROWS + 10
    assert 5000.0 <= fine.t[-1] < 1e6


SCHEDULES = {
    "none": (),
    "impulse at once": (
        Pulse(0.0, 0.0, "x", np.array([5.0, 0, 0])),
        Pulse(2.0, 0.0, "x", np.array([5.0, 0, 0])),
    ),
    "widths": tuple(
        Pulse(t, 0.5, "x", np.array([5.0, 0, 0]), np.array([10.0, 0, 0])) for t in (0.25, 2.0, 3.0)
    ),
    "side by side": tuple(
        Pulse(t, 1.0, "x", np.array([5.0, 0, 0]), np.array([5.0, 0, 0])) for t in (1.5, 2.5)
    ),
}


@pytest.mark.parametrize("pulses", SCHEDULES.values(), ids=SCHEDULES)
@pytest.mark.parametrize("fly", [propagation.flown, propagation.by_impulses])
def test_stretches_cover_the_track_and_name_every_pulse_once(
    pulses: tuple[Pulse, ...], fly: type
) -> None:
    made: propagation.Flight = fly(spinner(), Schedule(pulses), 6.0)
    track = made.sampled(50, 6.0)
    found = list(geometry.stretches(made, track))
    assert found[0][0].start == 0
    assert found[-1][0].stop == len(track.t)
    assert all(one.stop == other.start + 1 for (one, _), (other, _) in pairwise(found))
    assert [pulse for _, pulse in found if pulse is not None] == list(range(len(pulses)))
    for rows, pulse in found:
        if pulse is not None:
            assert (track.t[rows][0], track.t[rows][-1]) == pytest.approx(made.spans[pulse])


def test_pulses_after_the_end_of_the_track_are_left_out() -> None:
    made = propagation.flown(spinner(), Schedule(SCHEDULES["widths"]), 6.0)
    assert [pulse for _, pulse in geometry.stretches(made, made.sampled(20, 1.0))] == [0, None]


def test_a_herpolhode_that_never_closes_fills_the_circle_about_it() -> None:
    """The space cone of I1 ≠ I2 over a long time reaches as far as it does in one period, all
    around.
    """
    body = spinner(moments=(120.0, 100.0, 80.0), degrees=25.0)
    made = propagation.flown(body, Schedule(), 600.0)
    found = geometry.cones(made, body.initial.rates, body.initial.quaternion)
    away = attitude.angle_between(found.swept, found.momentum)
    assert np.ptp(away) < 1e-9
    assert attitude.angle_between(found.space, found.momentum).max() == pytest.approx(away[0])
    motion = reference.fly(
        (120.0, 100.0, 80.0), body.omega0, [], 97.3, attitude.matrix(body.initial.quaternion)
    )
    unit = motion.rotation @ (motion.rates / np.linalg.norm(motion.rates))
    assert attitude.angle_between(unit, found.momentum) <= away[0] + 1e-9
    still = BODIES["oblate"]
    cones = geometry.cones(
        propagation.flown(still, Schedule(), 1.0), still.initial.rates, still.initial.quaternion
    )
    assert np.array_equal(cones.swept, cones.space)


def test_a_hull_of_points_on_a_line_is_its_ends() -> None:
    line = np.column_stack([np.linspace(0.0, 1.0, 9), np.linspace(0.0, 2.0, 9)])
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for points, corners in (
        (np.vstack([0.5 * square + 0.2, square]), square),
        (line, line[[0, -1]]),
        (line[:1], line[:1]),
        (np.zeros((4, 2)), np.zeros((1, 2))),
    ):
        assert {*map(tuple, geometry.hull(points))} == {*map(tuple, corners)}


@pytest.mark.parametrize(
    ("low", "high"), [(-1.0, 1.0), (0.0, 1e-7), (-3e5, 4.1e5), (38.99, 41.01), (-1e-9, 2e-9)]
)
@pytest.mark.parametrize("most", [5, 9])
def test_ticks_are_round_and_few(low: float, high: float, most: int) -> None:
    found = geometry.ticks(low, high, most)
    assert 1 <= len(found) <= most + 1
    assert all(low - 1e-9 * (high - low) <= value <= high + 1e-9 * (high - low) for value in found)
    steps = np.diff(found)
    assert steps == pytest.approx(steps[0])
    mantissa = steps[0] / 10.0 ** math.floor(math.log10(steps[0]) + 1e-9)
    assert min(abs(mantissa - round_) for round_ in (1.0, 2.0, 5.0)) < 1e-6


@pytest.mark.parametrize(
    ("tensor", "spin", "note"),
    [
        (np.diag([100.0, 120.0, 80.0]), 3.0, ""),
        (
            np.array([[100.0, 1.0, 0.0], [1.0, 120.0, 0.0], [0.0, 0.0, 80.0]]),
            3.0,
            ", principal axes",
        ),
        (np.diag([80.0, 80.0, 120.0]), -3.0, ", spin about −3"),
    ],
)
def test_the_pole_curve_says_where_its_axes_are_not_those_of_the_file_and_spin_is_reversed(
    tensor: Vector, spin: float, note: str
) -> None:
    state = {"spin": spin, "nutation": "5 deg"}
    body = nutdamp.load({"name": "x", "inertia": {"tensor": tensor.tolist()}, "state": state})
    assert geometry.pole_note(propagation.flown(body, Schedule(), 1.0)) == note

"""The motion as arrays: rows round each pulse, tracks in pieces and as CSV, and how far the spin
axis strays.
"""

import io
import math
from collections.abc import Iterable
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.builders import channel, pulse, spinner
from support.spinning import schedules, series, symmetric_spinners, triaxial_spinners

from nutdamp.common import work
from nutdamp.common.numerics import SAME_ANGLE
from nutdamp.errors import Infeasible
from nutdamp.files.tabular import HEADER, number, track_array, write_track
from nutdamp.flight import dynamics as motion
from nutdamp.flight import propagation
from nutdamp.physics import attitude
from nutdamp.physics import body as rigid_body
from nutdamp.planning.simulation import extremes
from nutdamp.spacecraft.model import Attitude, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

EPS = float(np.finfo(float).eps)
FLIES = (propagation.by_impulses, propagation.flown)
WIDE = Schedule(
    (
        pulse(2.0, 0.5, np.array([5.0, 0.0, 0.0]), "one"),
        pulse(4.0, 1.0, np.array([0.0, -5.0, 2.0]), "two"),
        pulse(6.5, 0.0, np.array([3.0, 3.0, 0.0]), "kick"),
    )
)
UNTIL, FEW = 40.0, 7


def some_flight() -> propagation.Flight:
    """A flight with coasts and wide pulses, the first of them at once."""
    push = channel("T", 4.0, 1.0, 0.5)
    made = Schedule(
        tuple(
            channel_pulse(push, t, on_time) for t, on_time in ((0.25, 0.5), (4.0, 0.7), (20.0, 3.0))
        )
    )
    return propagation.flown(spinner(degrees=12.0, channels=(push,)), made, UNTIL)


def cut(whole: propagation.Track, edges: Iterable[int]) -> list[propagation.Track]:
    """The rows between ``edges``, as tracks of their own."""
    return [
        propagation.Track(
            **{one.name: getattr(whole, one.name)[begin:end] for one in fields(propagation.Track)}
        )
        for begin, end in pairwise([0, *edges, len(whole.t)])
        if end > begin
    ]


@pytest.mark.parametrize("fly", FLIES)
def test_a_track_goes_from_zero_to_its_end_in_order_and_no_row_comes_twice(fly: object) -> None:
    for samples in (1, 2, 11, 1000):
        whole = fly(spinner(), WIDE, 10.0).sampled(samples, 10.0)  # type: ignore[operator]
        assert (whole.t[0], whole.t[-1]) == (0.0, 10.0)
        assert np.all(np.diff(whole.t) >= 0.0)
        assert np.all(np.diff(whole.pulse) >= 0)
        assert set(np.linspace(0.0, 10.0, samples)) <= set(whole.t)
        rows = np.column_stack([whole.t, whole.rates, whole.quaternion])
        assert len(np.unique(rows, axis=0)) == len(rows)


def test_by_impulses_there_is_a_row_before_and_one_after_each_pulse() -> None:
    rows = propagation.by_impulses(spinner(), WIDE, 10.0).sampled(3, 10.0)
    effective = propagation.effective_impulses(spinner(), WIDE)
    for index, (one, acting) in enumerate(zip(WIDE, effective, strict=True)):
        at = np.flatnonzero(rows.t == one.t)
        assert rows.pulse[at].tolist() == [index, index + 1]
        jump = np.diff(rows.rates[at], axis=0)[0] * np.array([120.0, 120.0, 80.0])
        assert jump == pytest.approx([acting.real, acting.imag, one.impulse[2]], abs=1e-12)
        assert rows.quaternion[at[0]] == pytest.approx(rows.quaternion[at[1]], abs=4 * EPS)


def test_flown_there_is_a_row_as_each_pulse_begins_and_one_as_it_ends() -> None:
    rows = propagation.flown(spinner(), WIDE, 10.0).sampled(3, 10.0)
    for index, one in enumerate(WIDE):
        assert index in rows.pulse[rows.t == one.start]
        assert one.end in rows.t
    kick = np.flatnonzero(rows.t == 6.5)
    assert rows.pulse[kick].tolist() == [2, 3]
    assert np.diff(rows.rates[kick], axis=0)[0] == pytest.approx([3 / 120, 3 / 120, 0], abs=4 * EPS)
    # The row at the end of a pulse counts it as completed, the last one too.
    made = Schedule(WIDE.pulses[:2])
    rows = propagation.flown(spinner(), made, made.end).sampled(3, made.end)
    assert [rows.pulse[rows.t == one.end].max() for one in made] == [1, 2]


@pytest.mark.parametrize("fly", FLIES)
def test_an_ideal_impulse_at_zero_has_the_motion_before_it_too(fly: object) -> None:
    made = Schedule((pulse(0.0, 0.0, np.array([6.0, 0.0, 0.0])),))
    rows = fly(spinner(), made, 5.0).sampled(5, 5.0)  # type: ignore[operator]
    assert (rows.t[:2].tolist(), rows.pulse[:3].tolist()) == ([0.0, 0.0], [0, 1, 1])
    assert np.array_equal(rows.rates[0], spinner().omega0)
    assert rows.rates[1] - rows.rates[0] == pytest.approx([6 / 120, 0, 0], abs=2 * EPS)


@pytest.mark.parametrize("fly", FLIES)
def test_motion_around_pulses(fly: object) -> None:
    """|ω| before the first, between, and after the last, as the whole track has it."""
    flown = fly(spinner(), WIDE, 10.0)  # type: ignore[operator]
    before, after = flown.around_pulses()
    assert (before.pulse.tolist(), after.pulse.tolist()) == ([0, 1, 2], [1, 2, 3])
    assert before.nutation[0] == pytest.approx(spinner().nutation, rel=8 * EPS)
    assert before.nutation[1:] == pytest.approx(after.nutation[:-1], rel=100 * EPS)
    assert after.nutation[-1] == pytest.approx(flown.residual.nutation, rel=8 * EPS)
    coasting = fly(spinner(), Schedule(), 7.0)  # type: ignore[operator]
    assert np.array_equal(coasting.sampled(8, 7.0).t, np.linspace(0.0, 7.0, 8))
    assert [len(rows.t) for rows in coasting.around_pulses()] == [0, 0]


def test_cone_angles_are_those_of_the_rates_axis_and_momentum_those_of_the_attitude() -> None:
    body = spinner(spin=-3.0, degrees=20.0)
    rows = propagation.flown(body, WIDE, 10.0).sampled(20, 10.0)
    omega = np.hypot(rows.rates[:, 0], rows.rates[:, 1])
    spin = -rows.rates[:, 2]
    assert rows.nutation == pytest.approx(
        rigid_body.nutation_angle(120.0, 80.0, omega, spin), abs=4 * EPS
    )
    assert rows.body_cone == pytest.approx(rigid_body.body_cone(omega, spin), abs=4 * EPS)
    assert rows.space_cone == pytest.approx(
        rigid_body.space_cone(120.0, 80.0, omega, spin), abs=8 * EPS
    )
    between = [reference.angle(h, axis) for h, axis in zip(rows.momentum, rows.axis, strict=True)]
    assert rows.nutation == pytest.approx(between, abs=1e-13)
    up = np.array([0.0, 0.0, -1.0])
    assert rows.axis == pytest.approx(attitude.rotate(rows.quaternion, up), abs=4 * EPS)
    momentum = attitude.rotate(rows.quaternion, rows.rates * body.inertia.moments)
    assert rows.momentum == pytest.approx(momentum, rel=1e-14, abs=1e-12)


def pointing(axes: np.ndarray) -> propagation.Track:
    """Rows whose spin axis is ``axes`` (n, 3), at whole seconds; H at the start along z."""
    nothing = np.zeros(len(axes))
    up = np.tile([0.0, 0.0, 2.0], (len(axes), 1))
    t = np.arange(float(len(axes)))
    pulses = np.zeros(len(axes), dtype=np.int64)
    return propagation.Track(
        t, up, np.zeros((len(axes), 4)), axes, up, nothing, nothing, nothing, pulses
    )


TILTS = [(0, 80), (90, 70), (180, 60), (270, 85)]
"""Out of the y-z and the x-z plane, by x and y."""


@pytest.mark.parametrize(
    ("places", "expected"),
    [
        ([(10, 5), (50, -20), (30, 40)], {"right_ascension": (10, 50), "declination": (-20, 40)}),
        (
            [(350, 0), (355, 1), (5, 2), (20, 0)],
            {"right_ascension": (350, 380)},
        ),  # the short way round
        ([(200, 10), (200, 10)], {"right_ascension": (200, 200)}),
        (TILTS, {"x": (-30, 10), "y": (-5, 20)}),
    ],
)
def test_ranges_of_the_spin_axis(
    places: list[tuple[float, float]], expected: dict[str, tuple[float, float]]
) -> None:
    """By right ascensions and declinations, deg."""
    r, d = np.radians(places).T
    found = extremes(
        [pointing(np.column_stack([np.cos(d) * np.cos(r), np.cos(d) * np.sin(r), np.sin(d)]))]
    )
    assert {name: np.degrees(getattr(found, name)) for name in expected} == {
        name: pytest.approx(ends, abs=1e-12) for name, ends in expected.items()
    }
    if places == TILTS:  # how far from H, and when
        assert found.farthest == pytest.approx((math.radians(30), 2.0), rel=1e-14)
        assert found.nearest == pytest.approx((math.radians(5), 3.0), rel=1e-14)


@pytest.mark.parametrize("right_ascension", [0.0, 90.0, 358.0])
def test_extremes_in_the_frame_of_the_file(right_ascension: float) -> None:
    """H towards a place on the equator: the axis circles it at 12°, across the zero of right
    ascension or not.
    """
    r = math.radians(right_ascension)
    until = spinner().inertial_period
    # Rows: z of N to the equator at r, x of N to the pole.
    place = np.array([[0, math.sin(r), math.cos(r)], [0, -math.cos(r), math.sin(r)], [1, 0, 0]])
    facing = attitude.from_matrix(place @ attitude.matrix(spinner(degrees=12.0).initial.quaternion))
    there = spinner(degrees=12.0, attitude=Attitude(facing))
    found = extremes([propagation.flown(there, Schedule(), until).sampled(4001, until)])
    west = (right_ascension - 12) % 360
    assert np.degrees(found.declination) == pytest.approx([-12, 12], abs=1e-4)
    assert np.degrees(found.right_ascension) == pytest.approx([west, west + 24], abs=1e-4)


@given(st.integers(1, 60), st.floats(0.0, 10.0), st.floats(0.0, 10.0), st.floats(0.1, 10.0))
def test_even_times_are_those_of_linspace(
    samples: int, first: float, second: float, until: float
) -> None:
    start = min(first, second)
    end = max(first, second)
    even = np.linspace(0.0, until, samples)
    parts = list(propagation.even_times(samples, until, start, end))
    assert (
        np.concatenate([times for times, _, _ in parts]).tolist()
        == even[(even > start) & (even < end)].tolist()
    )
    assert [begins for _, begins, _ in parts] == [True] + [False] * (len(parts) - 1)
    assert [ends for _, _, ends in parts] == [False] * (len(parts) - 1) + [True]


@pytest.mark.parametrize("samples", [1, 2, 50, 333])
def test_the_pieces_of_a_track_are_its_rows(samples: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made = some_flight()
    whole = made.sampled(samples, UNTIL)
    monkeypatch.setattr(propagation, "PIECE", FEW)
    pieces = list(made.pieces(samples, UNTIL))
    assert len(pieces) >= len(whole.t) // (2 * FEW)
    assert max(len(piece.t) for piece in pieces) <= 2 * FEW + 4
    for one in fields(propagation.Track):
        joined = np.concatenate([getattr(piece, one.name) for piece in pieces])
        assert joined == pytest.approx(getattr(whole, one.name), rel=1e-14, abs=1e-13)


def test_extremes_of_pieces_are_those_of_the_whole() -> None:
    made = some_flight()
    generator = np.random.default_rng(4)
    for count in (1, 5, 40, 500):
        whole = made.sampled(count, UNTIL)
        found = extremes([whole])
        assert (
            extremes(cut(whole, np.sort(generator.integers(0, len(whole.t), 3)).tolist())) == found
        )
        assert (found.rows, found.until) == (len(whole.t), UNTIL)
    # Of what is equal but for rounding the first time counts.
    angles = np.array([0.1, 0.3, 0.2, 0.3 + 0.4 * SAME_ANGLE, 0.25, 0.3 + 0.9 * SAME_ANGLE, 0.1])
    whole = pointing(np.column_stack([np.sin(angles), np.zeros(7), np.cos(angles)]))
    for size in (1, 2, 3, 7):
        found = extremes(cut(whole, range(size, 7, size)))
        assert found.farthest == pytest.approx((0.3, 1.0), abs=1e-15)
        assert found.nearest == pytest.approx((0.1, 0.0), abs=1e-15)


def test_a_track_is_written_as_it_was_by_numbers() -> None:
    made = some_flight()
    stream = io.BytesIO()
    whole = made.sampled(100, UNTIL)
    write_track(cut(whole, [50]), made.spacecraft.inertia, stream)
    header, *lines, last = stream.getvalue().decode().split("\r\n")
    assert (header, last) == (",".join(HEADER), "")
    rows = track_array(whole, made.spacecraft.inertia).tolist()
    assert lines == [",".join([*map(number, row[:-1]), str(row[-1])]) for row in rows]


# --- flights of trial schedules: flown anew from the first pulse that has changed, and the same to
# the last bit

THREE = spinner(moments=(100.0, 120.0, 80.0))


def bits(flown: propagation.Flight) -> list[bytes]:
    """All that a flight gives: legs, motion along them and how it ends."""
    legs = [
        repr((one.start, one.end, one.completed, one.jump, one.completed_at_end)).encode()
        for one in flown.legs
    ]
    motion = flown.motion(np.linspace(0.0, flown.legs[-1].end, 50))
    settled = flown.settled
    return [*legs, *(part.tobytes() for part in (*motion, settled.rates, settled.quaternion))]


def train(count: int, moved: int | None = None) -> Schedule:
    """So many pulses, one every 4 s; the one with the number
    ``moved`` comes later and is longer.
    """
    pulses = [(4.0 * n + 1.0, 0.5) if n != moved else (4.0 * n + 1.2, 0.7) for n in range(count)]
    return Schedule(tuple(pulse(t, on, on * np.array([3.0, -2.0, 0.5])) for t, on in pulses))


@pytest.mark.deep
@given(
    st.one_of(symmetric_spinners(), triaxial_spinners()),
    st.sampled_from([0.0, 200.0]),
    st.lists(st.one_of(schedules(), schedules(ideal=True)), min_size=2, max_size=3),
)
def test_what_is_remembered_changes_no_bit(
    body: Spacecraft, constant: float, every: list[Schedule]
) -> None:
    body = replace(body, dissipation=constant) if constant else body
    remembering = motion.make_dynamics(body).remembering()
    mixed = [Schedule((*one.pulses, *other.pulses)) for one in every for other in every]
    for made in (*every, *mixed, *every):
        assert bits(propagation.flown(body, made, dynamics=remembering)) == bits(
            propagation.flown(body, made)
        )


@pytest.mark.parametrize("moved", [0, 3, 7])
def test_a_trial_costs_what_comes_after_the_pulse_that_has_changed(moved: int) -> None:
    remembering = motion.make_dynamics(THREE).remembering()
    propagation.flown(THREE, train(8), dynamics=remembering)
    with work.budget("trial", 1e9) as trial:
        flown = propagation.flown(THREE, train(8, moved), dynamics=remembering)
    assert bits(flown) == bits(propagation.flown(THREE, train(8, moved)))
    changed = [
        leg for leg in flown.legs if leg.end > 4.0 * moved + 0.75
    ]  # a leg for each coast, pulse, and the end
    assert len(changed) == 2 * (8 - moved) + 1
    integrated = [leg for leg in changed if leg.end > leg.start]
    steps = sum(leg.path.steps for leg in integrated)
    expected = len(changed) * motion.LEG + len(integrated) * motion.PULSE + steps * motion.STEP
    assert trial.done == pytest.approx(expected)


def test_a_flight_that_is_remembered_keeps_its_limit_of_steps() -> None:
    remembering = motion.make_dynamics(THREE).remembering()
    torque = [np.array([0.0, 0.0, 0.1])]
    path, _ = remembering.path(THREE.initial, 0.0, 50.0, torque, most=1000)
    assert remembering.path(THREE.initial, 0.0, 50.0, torque, most=path.steps)[0] is path
    with pytest.raises(Infeasible):
        remembering.path(THREE.initial, 0.0, 50.0, torque, most=path.steps - 1)


@given(triaxial_spinners())
def test_a_long_coast_in_closed_form_is_that_of_taylor_series(body: Spacecraft) -> None:
    end = 3.0 * motion.LONG / float(np.linalg.norm(body.omega0))
    path, after = motion.make_dynamics(body).path(body.initial, 0.0, end, most=1000)
    pieces = series(
        body.inertia.moments, np.zeros(3), body.omega0, body.initial.quaternion, 0.0, end
    )
    rates, quaternion = pieces[-1].end()
    assert path.steps == 0
    assert np.allclose(after.rates, rates, rtol=0.0, atol=1e-10 * np.linalg.norm(rates))
    assert np.allclose(after.quaternion, quaternion, rtol=0.0, atol=1e-10)


def test_legs_are_forgotten_before_they_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "REMEMBERED", 3)
    body = spinner()
    remembering = motion.make_dynamics(body).remembering()
    for made in (train(2), train(2, 1), train(2, 0)):
        assert bits(propagation.flown(body, made, dynamics=remembering)) == bits(
            propagation.flown(body, made)
        )
    assert 0 < len(remembering.known or ()) <= 3

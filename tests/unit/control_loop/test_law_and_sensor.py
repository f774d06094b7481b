"""What the sensors show, and when the law fires by it: Magnus' sign table, closed forms, motions by
DOP853.
"""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from support import reference
from support.builders import channel, cross, present, spinner
from support.cases import deep, spread
from support.golden import refused
from support.loops import fired_by, fires, four, transverse_size, turned

from nutdamp.control_loop.controller import Watch
from nutdamp.control_loop.law import ComplexArray, Firing, Law
from nutdamp.control_loop.sensor import HARMONIC, Estimator, Signal, felt, gain, is_blind, lag
from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import make_dynamics
from nutdamp.spacecraft.equipment import ACCELEROMETER, BANG, ONE_PULSE, Loop, Sensor
from nutdamp.spacecraft.model import Limits, Spacecraft, Vector

FOUR = four(least=0.01, most=1.0)
TABLE = {"+M1": (1, 1), "-M1": (1, -1), "+M2": (0, -1), "-M2": (0, 1)}
"""Magnus 1970, section 4, for a ω3 > 0: which of ω1, ω2 is zero as a channel fires, and how it then
changes.
"""


def first_firing(law: Law, z: complex, spin: float = 3.0) -> Firing:
    return present(law.firing(law.actuators[0], z, spin))


def after(
    moments: tuple[float, float, float], rates: Vector, torque: Vector, start: float, width: float
) -> Vector:
    """Rates after a coast from ``rates`` and a pulse, by DOP853; then rates along an arc of 7.5 s:
    (n, 3).
    """
    begun, end = reference.Motion(rates, np.eye(3)), start + width
    times = end + np.linspace(0.0, 7.5, 376)
    path = reference.path(moments, begun, [reference.Push(start, end, torque)], times)
    return np.array([each.rates for each in path])


@pytest.mark.parametrize(("share", "dissipation", "horizon", "firing"), [
    (0.51, None, None, 4),
    (0.49, None, None, 2),
    (0.49, 40.0, None, 4),  # two alone do not outdo the growth
    (0.49, 400.0, None, 2),
    (0.49, None, 108.0, 4),  # nor end in half the time
    (0.49, None, 112.0, 2),
])  # fmt: skip
def test_channels_that_waste_stay_off_unless_growth_or_horizon_needs_them(
    share: float, dissipation: float | None, horizon: float | None, firing: int
) -> None:
    """|ω|, 0.175 rad/s at 5 deg, falls by 2Mτ/A in a period of 6.28 s: to nothing in 55 s."""
    strong = cross(4.0, max_on_time=0.3)[:2]
    weak = cross(share * 4.0, "R", max_on_time=0.3)[2:]
    spends = tuple(replace(each, spends=4.0) for each in weak)  # as much as strong ones do
    body = fired_by(
        5.0, (*strong, *spends), dissipation=dissipation, limits=Limits(horizon=horizon)
    )
    assert len(Law(body, fires()).actuators) == firing


@pytest.mark.parametrize(("C", "spin"), [(80.0, 3.0), (80.0, -3.0), (160.0, 3.0), (160.0, -3.0)])
def test_sign_table_of_magnus_and_its_mirror_image(C: float, spin: float) -> None:
    law = Law(fired_by(5.0, FOUR, C=C, spin=spin), Loop(Sensor(), start=0.01))
    rate = (120.0 - C) / 120.0 * spin
    for actuator in law.actuators:
        z = 0.1 * cmath.exp(0.3j)
        firing = present(law.firing(actuator, z, spin))
        then = z * cmath.exp(-1j * rate * (firing.wait + 0.5 * firing.on_time))
        change = -1j * rate * then
        zero, sign = TABLE[actuator.channel.name]
        assert (then.real, then.imag)[zero] == pytest.approx(0.0, abs=1e-14)
        assert math.copysign(1.0, (change.real, change.imag)[zero]) == sign * (
            -1 if rate < 0.0 else 1
        )
        assert (then * actuator.kick.conjugate()).real < 0.0  # whatever the table: against ω


@spread(
    "moments",
    [(120.0, 120.0, 80.0), (80.0, 80.0, 120.0), (120.0, 95.0, 80.0), (70.0, 90.0, 130.0)],
    quick=1,
)
@spread("spin", [2.0, -2.0], quick=1)
def test_a_firing_lowers_the_nutation_as_much_as_can_be(
    moments: tuple[float, float, float], spin: float
) -> None:
    """Moved by a few degrees to either side it lowers less: by DOP853, small angles."""
    for degrees in (10.0, 205.0):
        push = 0.5 * cmath.exp(1j * math.radians(degrees))
        torque = np.array([push.real, push.imag, 0.0])
        craft = spinner(moments=moments, spin=spin, degrees=0.2, channels=(channel("T", *torque),))
        law = Law(craft, Loop(Sensor(), start=1e-4, on_time=0.4))
        firing = first_firing(law, complex(law.seen(complex(*craft.omega0[:2]))), spin)
        start = firing.wait % craft.body_period + craft.body_period

        def widest(
            at: float,
            push: Vector = torque,
            of: Spacecraft = craft,
            sense: float = math.copysign(1.0, spin),
        ) -> float:
            rates = after(moments, of.omega0, push, at, 0.4)
            return max(reference.nutation(moments, each, sense) for each in rates)

        assert widest(start) < min(
            widest(start - 0.3), widest(start + 0.3), widest(start, np.zeros(3))
        )


@pytest.mark.parametrize("kind", ["four-pulse", ONE_PULSE, BANG])
@pytest.mark.parametrize("predict", [True, False])
def test_waits_of_many_moments_are_those_of_each(kind: str, predict: bool) -> None:
    rng = np.random.default_rng(3)
    channels = (
        *FOUR,
        channel("slanted", 2.0, 3.0, 0.0, min_on_time=0.02),
        channel("axial", 2.0, -1.0, 0.9),
    )
    on_time = 0.05 if kind != ONE_PULSE else None
    law = Law(
        spinner(channels=channels),
        Loop(Sensor(), kind, start=0.01, predict=predict, on_time=on_time),
    )
    z = (
        rng.normal(size=200)
        * np.exp(rng.uniform(-9.0, 0.0, size=200))
        * np.exp(1j * rng.uniform(0, 7, size=200))
    )
    spin = rng.uniform(2.5, 3.5, size=200)
    for actuator in law.actuators:
        single = [
            law.firing(actuator, complex(each), float(turn))
            for each, turn in zip(z, spin, strict=True)
        ]
        wanted = np.array([math.nan if each is None else each.wait for each in single])
        off = 1e-12 if actuator.spin_rate == 0.0 else 0.03
        assert np.allclose(
            law.waits(actuator, z, spin), wanted, rtol=1e-12, atol=off, equal_nan=True
        )


def test_on_time_is_the_exact_one_for_what_is_left() -> None:
    """τ = (2/(aω3)) asin(aω3 A|ω|/(2M)), flown by DOP853: nothing is left."""
    craft = fired_by(0.4, FOUR)
    firing = first_firing(
        Law(craft, Loop(Sensor(), ONE_PULSE, start=1e-4)), complex(*craft.omega0[:2])
    )
    rate = 3.0 / 3.0
    left = 120.0 * transverse_size(craft.omega0)
    assert firing.on_time == pytest.approx(
        2.0 / rate * math.asin(rate * left / (2.0 * 6.0)), rel=1e-13
    )
    start = firing.wait % craft.body_period
    torque = np.array([6.0, 0.0, 0.0])
    assert (
        transverse_size(after((120, 120, 80), craft.omega0, torque, start, firing.on_time)[0])
        < 1e-11
    )


def test_a_pulse_that_would_leave_more_than_it_finds_is_not_fired() -> None:
    law = Law(fired_by(5.0, FOUR), Loop(Sensor(), start=1e-4))
    smallest = 0.01 * 6.0 / 120.0
    assert law.firing(law.actuators[0], complex(0.499 * smallest), 3.0) is None
    assert law.firing(law.actuators[0], complex(0.501 * smallest), 3.0) is not None


def test_no_law_for_a_sphere_or_without_channels() -> None:
    for key, body in (
        ("sphere", fired_by(5.0, FOUR, A=100.0, C=100.0)),
        ("no-channels", spinner()),
    ):
        with refused(Infeasible, f"loop.{key}"):
            Law(body, fires())


def test_size_and_nutation_are_inverse_and_those_of_the_arc() -> None:
    for moments in ((120.0, 120.0, 80.0), (120.0, 95.0, 80.0), (70.0, 90.0, 130.0)):
        craft = fired_by(0.05, FOUR, moments=moments)
        law = Law(craft, fires())
        size = abs(complex(law.seen(complex(*craft.omega0[:2]))))
        assert float(law.nutation(size, 3.0)) == pytest.approx(craft.nutation, rel=1e-5)
        assert law.size(float(law.nutation(size, 3.0)), -3.0) == pytest.approx(size)


BODIES = ((120.0, 120.0, 80.0), (80.0, 80.0, 120.0), (120.0, 100.0, 80.0), (70.0, 80.0, 120.0))
UP, SIDE = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
AT, ALONG = np.array([0.9, -0.4, 0.7]), np.array([0.36, 0.48, 0.8])
FELT = Sensor(ACCELEROMETER, 100.0, position=AT, axis=ALONG)


def body(
    moments: tuple[float, float, float] = BODIES[0], spin: float = 3.0, degrees: float = 0.5
) -> Spacecraft:
    return spinner(
        moments=moments, spin=spin, degrees=degrees, channels=(channel("+M1", 5.0, 0.0, 0.0),)
    )


@pytest.mark.parametrize(("moments", "spin"), [*zip(BODIES, (3.0, -3.0, -3.0, 3.0), strict=True)])
def test_accelerometer_shows_what_a_point_of_the_body_does(
    moments: tuple[float, float, float], spin: float
) -> None:
    """Its gain is the part that is linear in the transverse rate."""
    craft = body(moments, spin, 6.0)
    step = 1e-3
    small = 1e-6
    start = reference.Motion(craft.omega0, np.eye(3))
    places = reference.coast(moments, start, np.zeros(3), np.linspace(step, 5.0 * step, 5))
    points = np.array([each.rotation @ AT for each in places])
    acceleration = (-points[0] + 16 * points[1] - 30 * points[2] + 16 * points[3] - points[4]) / (
        12 * step * step
    )
    middle = places[2]
    signal = Signal(craft, FELT, (1,))
    shown = signal.shown(middle.rates[None, :])[0, 0]
    assert shown == pytest.approx(ALONG @ middle.rotation.T @ acceleration, abs=2e-8)
    rates = np.array(
        [[small, 0.0, spin], [-small, 0.0, spin], [0.0, small, spin], [0.0, -small, spin]]
    )
    slopes = (signal.shown(rates)[::2, 0] - signal.shown(rates)[1::2, 0]) / (2 * small)
    assert np.array(gain(moments, AT, ALONG)) * spin == pytest.approx(slopes, rel=1e-8)


def test_accelerometer_along_axis_3_is_blind_for_a_flat_disc_alone() -> None:
    for C in (60.0, 150.0, 199.0):
        assert gain((100.0, 100.0, C), np.array([2.0, 0.0, 0.3]), UP)[0] == pytest.approx(
            2.0 * (2.0 - C / 100.0)
        )
    for C, at, along, blind in (
        (200, SIDE, UP, True),
        (200, SIDE, SIDE + UP, False),
        (199, SIDE, UP, False),
    ):
        assert is_blind((100.0, 100.0, C), 2.0 * at + 0.3 * UP, along) is blind
    assert is_blind((100.0, 100.0, 150.0), UP, UP)


def test_a_torque_is_felt() -> None:
    craft = body()
    sensor = Sensor(ACCELEROMETER, 100.0, position=SIDE)
    quiet, pushed = (
        felt(sensor, craft.inertia.moments, craft.omega0, torque)[0]
        for torque in (None, (0.0, 6.0, 0.0))
    )
    assert pushed - quiet == pytest.approx(-6.0 / 120.0)


def test_noise_of_a_sample_is_the_same_however_it_is_come_by() -> None:
    def noise(numbers: NDArray[np.int64], seed: int = 7) -> Vector:
        signal = Signal(body(), Sensor(rate=100.0, noise=0.1), (seed,))
        return signal.sampled(numbers, np.zeros((len(numbers), 2)))

    whole = noise(np.arange(9000))
    numbers = np.arange(4000, 8500)
    assert whole.std() == pytest.approx(0.1, rel=0.02)
    assert np.array_equal(noise(numbers), whole[numbers])
    assert np.array_equal(noise(numbers[::7]), whole[numbers[::7]])
    assert not np.array_equal(noise(numbers, 8), whole[numbers])


def test_steps_scale_and_bias() -> None:
    signal = Signal(body(), Sensor(rate=10.0, quantisation=0.02, scale=-1.5, bias=0.013), (1,))
    shown = signal.shown(np.array([[0.1, -0.2, 3.0]]))
    assert shown[0] == pytest.approx([-0.15 + 0.013, 0.3 + 0.013])
    assert signal.sampled(np.array([0]), shown)[0] == pytest.approx([-0.14, 0.32])


def test_gyros_measure_about_axes_of_the_file() -> None:
    """What they show of ω3 is no nutation; turned about axis 3 alone they show what those of
    principal axes do.
    """
    axes = turned(0.02, -0.03, 0.5)
    rates = np.array([[0.1, -0.2, 3.0], [0.0, 0.0, -2.0]])
    assert Signal(body(), Sensor(axes=axes[:2]), (1,)).shown(rates) == pytest.approx(
        (rates @ axes.T)[:, :2]
    )
    for craft in (body(), body((120.0, 95.0, 80.0))):
        of_principal, turned_alone, tilted = (
            estimates(craft, Sensor(rate=50.0, axes=each[:2]))
            for each in (np.eye(3), turned(0.0, 0.0, 0.5), axes)
        )
        assert turned_alone[1] == pytest.approx(of_principal[1], abs=1e-14)
        first, second = Law(craft, Loop(Sensor(), start=0.01)).gauge
        standing = tilted[1] - of_principal[1]
        size = np.hypot(standing.real / first, standing.imag / second)
        assert size == pytest.approx(3.0 * math.tan(math.acos(axes[2, 2])), rel=1e-4)


def estimates(
    craft: Spacecraft, sensor: Sensor, cuts: tuple[int, ...] = ()
) -> tuple[Vector, ComplexArray, ComplexArray]:
    """Times, estimates of z with the filter taken out, and z itself, along a coast; fed in pieces
    at ``cuts``.
    """
    law = Law(craft, Loop(sensor, start=0.01))
    signal = Signal(craft, sensor, (1,))
    path = make_dynamics(craft).path(craft.initial, 0.0, 40.0, most=9999)[0]
    numbers = np.arange(int(40.0 * present(sensor.rate)))
    times = numbers / present(sensor.rate)
    rates = path.motion(times)[0]
    estimator = Estimator(law, sensor, 0.0)
    values = signal.sampled(numbers, signal.shown(rates))
    pieces = [
        estimator.best(estimator.feed(times[i], values[i], rates[i, 2]), rates[i, 2])
        for i in np.split(np.arange(len(times)), cuts)
    ]
    return times, np.concatenate(pieces), np.asarray(law.seen(rates[:, 0] + 1j * rates[:, 1]))


@pytest.mark.parametrize("moments", [BODIES[0], deep(BODIES[1]), deep(BODIES[2]), BODIES[3]])
def test_accelerometer_gives_the_rate_by_the_sine_of_a_period(
    moments: tuple[float, float, float],
) -> None:
    for at, along in (((1.0, 0.3, 0.2), UP), ((0.1, 0.3, 0.8), SIDE)):
        craft = body(moments, degrees=0.01 if moments[0] != moments[1] else 3.0)
        sensor = Sensor(ACCELEROMETER, 50.0, bias=0.3, position=np.array(at), axis=along)
        times, shown, true = estimates(craft, sensor)
        known = ~np.isnan(shown)
        assert times[known][0] == pytest.approx(craft.body_period, abs=0.05)
        assert np.abs(shown[known] - true[known]).max() < 1e-3 * np.abs(true).max()


@pytest.mark.parametrize("seed", range(12))
def test_an_accelerometer_overestimates_a_body_unknown_to_the_law_by_no_more_than_said(
    seed: int,
) -> None:
    draw = np.random.default_rng(seed)
    known = np.array([100.0, 100.0, draw.choice([40.0, 80.0, 150.0])])
    A, C = known[0] * draw.uniform(0.7, 1.4), known[2] * draw.uniform(0.8, 1.2)
    on_board, truth = (
        body(tuple(known), degrees=3.0),
        body((A, A, min(C, 1.95 * A)), degrees=draw.uniform(0.1, 10.0)),
    )
    place, along = draw.normal(size=3), draw.normal(size=3)
    sensor = Sensor(ACCELEROMETER, 20.0, position=place, axis=along / np.linalg.norm(along))
    law = Law(on_board, Loop(sensor, start=0.01))
    estimator = Estimator(law, sensor, 0.0)
    times = np.arange(800) / 20.0
    rates = make_dynamics(truth).path(truth.initial, 0.0, 40.0, most=9999)[0].motion(times)[0]
    shown = np.abs(estimator.feed(times, Signal(truth, sensor, (1,)).shown(rates), rates[:, 2]))
    size = abs(complex(*truth.omega0[:2]))
    assert estimator.window >= HARMONIC
    assert np.nanmax(shown) <= estimator.overestimate(truth, size) * size


def test_estimates_do_not_depend_on_the_pieces_in_which_samples_come() -> None:
    for sensor in (
        Sensor(rate=50.0, low_pass=0.3, noise=0.001),
        Sensor(ACCELEROMETER, 50.0, low_pass=0.1, noise=0.001, position=SIDE),
    ):
        whole, parts = (estimates(body(), sensor, cuts)[1] for cuts in ((), (3, 40, 41, 700, 1500)))
        assert np.allclose(whole, parts, rtol=1e-9, atol=1e-12, equal_nan=True)


def test_an_accelerometer_with_too_many_samples_in_a_period_is_refused_at_once() -> None:
    with pytest.raises(Infeasible, match="lower loop"):
        estimates(body(), Sensor(ACCELEROMETER, 1e6, position=SIDE))


@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_low_pass_filter_is_the_recursion_and_its_lag_is_known(spin: float) -> None:
    craft = body(spin=spin)
    sensor = Sensor(rate=20.0, low_pass=0.4, delay=0.05)
    law = Law(craft, Loop(sensor, start=0.01))
    values = np.random.default_rng(5).normal(size=(500, 2))
    beta = math.exp(-0.05 / 0.4)
    level = values[0].copy()
    wanted = []
    for row in values:
        level = beta * level + (1.0 - beta) * row
        wanted.append(complex(*level))
    filtered = Estimator(law, sensor, 0.0).feed(np.arange(500) / 20.0, values, np.full(500, spin))
    assert np.isnan(filtered[:40]).all()  # not used before it has forgotten how it began
    assert filtered[40:] == pytest.approx(np.array(wanted)[40:], abs=1e-13)
    _, best, true = estimates(craft, sensor)
    assert best[-1] == pytest.approx(true[-1], abs=1e-12)
    raw = best[-1] * (1.0 - beta) / (1.0 - beta * np.exp(1j * law.rate(spin) * 0.05))
    behind = np.angle(raw / true[-1]) + law.rate(spin) * 0.05
    assert lag(law, sensor, spin) == pytest.approx(behind, abs=1e-12)


def test_a_channel_comes_to_fire_where_it_is_due_as_z_is_first_known() -> None:
    """Not where the moment is past; later only as its wait falls below what is looked ahead."""
    law = Law(body(), Loop(Sensor(rate=20.0), start=0.01))
    waits = np.array([[math.nan, 0.0], [math.nan, -0.1 * law.period], [0.2, 0.2], [0.03, 0.01]])
    watch = Watch(law, 0.0)
    watch.ahead = 0.02
    assert watch.triggered(waits)[:, 0].tolist() == [True, False, False, True]

"""Bodies that are not as the schemes' model has them: unequal moments, disturbances, dissipation, nearly spheres."""

import cmath
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import aimed, channel, codes, cross, events, present, spinner, transverse, within
from support.cases import deep, spread, weekly
from support.feasible import left
from support.golden import check_text
from support.places import case
from support.process import Run

from nutdamp.files.reader import example_text, load_spacecraft, read_spacecraft
from nutdamp.flight import propagation
from nutdamp.physics import body as rigid_body
from nutdamp.physics import response, taylor
from nutdamp.planning import plan as planning
from nutdamp.planning.notes import infeasibility, plan_notes
from nutdamp.schemes.catalogue import CLASSIC, Options
from nutdamp.schemes.sequential import ImpulseBuilder, model_of, steady_omega
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Disturbance, Inertia, Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.views.check import checked_json

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
DISTURBED = Options(with_disturbances=True)
NEARLY_NOTHING = math.radians(1e-7)


def body(*moments: float, steerable: bool = False) -> Spacecraft:
    changed = replace(EXAMPLE, inertia=Inertia((moments[0], moments[1], moments[2])))
    return replace(changed, channels=(), steerable=Steerable(20.0, 220.0, 1.0)) if steerable else changed


def under(*disturbances: Disturbance) -> Spacecraft:
    return replace(EXAMPLE, disturbances=disturbances)


def left_by(spacecraft: Spacecraft, scheme: str, options: Options | None = None) -> float:
    return left(planning.plan(spacecraft, scheme, options)).nutation


def test_the_model_turns_at_the_true_nutation_rate() -> None:
    """0.775 rad/s for 120, 100, 80 kg m² and 3 rad/s, which the mean (0.818) misses; of a symmetric body it is that."""
    spacecraft = replace(body(120.0, 100.0, 80.0), omega0=np.array([0.1, 0.05, 3.0]))
    assert model_of(spacecraft).body.inertia.a * 3.0 == pytest.approx(0.775, abs=5e-4)
    assert spacecraft.inertia.a * 3.0 == pytest.approx(0.818, abs=5e-4)
    assert model_of(EXAMPLE).body is EXAMPLE
    assert model_of(EXAMPLE).exact


@spread("moments", [(123.0, 117.0, 80.0), (80.0, 84.0, 120.0), (120.0, 100.0, 80.0)], quick=1, deep=2)
@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse"])
def test_unequal_moments_are_trimmed_away(moments: tuple[float, ...], scheme: str) -> None:
    for steerable in (False, True):
        residual = left(planning.plan(body(*moments, steerable=steerable), scheme))
        assert residual.nutation < NEARLY_NOTHING
        assert residual.momentum_shift < NEARLY_NOTHING or scheme == "one-pulse"


@pytest.mark.parametrize("moments", [(120.0, 120.0, 80.0), (80.0, 80.0, 120.0)])
def test_dissipation_is_planned_for(moments: tuple[float, ...]) -> None:
    for scheme in ("one-pulse", "two-pulse"):
        damping = replace(body(*moments, steerable=True), dissipation=120.0)
        assert left_by(damping, scheme) < NEARLY_NOTHING
    for scheme in ("two-pulse", "half-cone"):  # a target on the spin axis takes one impulse
        facing = planning.plan(aimed(replace(spinner(steerable=Steerable()), dissipation=1000.0), 5.0, 0.0), scheme)
        assert len(facing.pulses) == 1
        assert max(left(facing).nutation, left(facing).axis_error) < 1e-12
    growing = planning.plan(replace(EXAMPLE, dissipation=60.0), "one-pulse")  # a train fires once more
    assert len(growing.pulses) > len(planning.plan(EXAMPLE, "one-pulse").pulses)
    assert left(growing).nutation < NEARLY_NOTHING


@spread(
    "disturbance",
    [Disturbance(0.3 + 0.1j), Disturbance(0.2j, rate=-EXAMPLE.spin), Disturbance(0.05 + 0j, rate=2.0)],
    deep=2,
    ids=["constant", "space-fixed", "turning"],
)
def test_with_disturbances_only_their_steady_tilt_is_left(disturbance: Disturbance) -> None:
    spacecraft = under(disturbance)
    tilt = spacecraft.inertia.A * abs(steady_omega(spacecraft, 0.0)) / (spacecraft.inertia.C * spacecraft.spin)
    for scheme in CLASSIC:
        made, nominal = planning.plan(spacecraft, scheme, DISTURBED), planning.plan(spacecraft, scheme)
        assert left(made).nutation == pytest.approx(math.atan(tilt), rel=2e-3, abs=1e-9)
        assert "remains-steady-tilt" in codes(plan_notes(made))
        # Plans stay nominal unless disturbances are asked for.
        assert [pulse.t for pulse in nominal.pulses] == [pulse.t for pulse in planning.plan(EXAMPLE, scheme).pulses]
        assert "remains-unplanned" in codes(plan_notes(nominal))


def test_an_axial_or_a_resonant_disturbance_is_fought() -> None:
    """The latter has no steady tilt."""
    axial = under(Disturbance(0j, axial=0.05))
    resonant = under(Disturbance(0.1 + 0j, rate=-EXAMPLE.inertia.a * EXAMPLE.spin))
    assert steady_omega(resonant, 0.0) == 0.0
    for scheme in CLASSIC:
        assert left_by(axial, scheme, DISTURBED) < NEARLY_NOTHING
        assert left_by(axial, scheme) > 100 * NEARLY_NOTHING
    for scheme in ("one-pulse", "two-pulse"):
        assert left_by(resonant, scheme, DISTURBED) < NEARLY_NOTHING
        assert left_by(resonant, scheme) > math.radians(0.02)


def test_steady_omega_is_the_forced_term_where_the_disturbance_beats_within_the_horizon() -> None:
    spacecraft, times = under(Disturbance(0.3 + 0.1j, rate=2.0)), np.linspace(0.0, 5.0, 7)
    shape, start = spacecraft.inertia, steady_omega(spacecraft, 0.0)
    torque = np.array([0.3 + 0.1j]), np.array([2.0])
    moved = response.rotating_torques(times, start, shape.nutation_rate(spacecraft.spin), shape.A, *torque)
    assert moved == pytest.approx(np.array([steady_omega(spacecraft, time) for time in times]), rel=1e-12)
    for beats, settles in ((0.9, False), (1.1, True)):
        rate = 2.0 * math.pi * beats / EXAMPLE.horizon - EXAMPLE.inertia.a * EXAMPLE.spin
        assert (steady_omega(under(Disturbance(0.1 + 0j, rate=rate)), 0.0) != 0.0) is settles


@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_a_walk_goes_on_while_the_spin_drifts(spin: float) -> None:
    """A pulse of half a second at 12 s; 2 N m about axis 3 change the spin by a quarter and ω's phase by 3.75 rad."""
    axial, jet = np.array([0.0, 0.0, 2.0]), channel("T", 8.0, 3.0, 0.0)
    drifting = replace(spinner(spin=spin, channels=(jet,)), disturbances=(Disturbance(0j, axial=2.0),))
    builder, pulse = ImpulseBuilder(drifting), channel_pulse(jet, 12.0, 0.5)

    def flown(end: float) -> complex:
        pushes = [reference.Push(0.0, 30.0, axial), reference.Push(pulse.start, pulse.end, jet.torque)]
        return transverse(reference.fly(drifting.inertia.moments, drifting.omega0, pushes, end).rates)

    assert builder.omega_at(10.0) == pytest.approx(flown(10.0), rel=1e-10)
    builder.fire(pulse)
    for time in (pulse.end, 30.0):
        assert builder.omega_at(time) == pytest.approx(flown(time), rel=1e-10)
    assert builder.spin == pytest.approx(spin + 2.0 / drifting.inertia.C * 12.0, rel=1e-14)


def test_within_rounding_of_a_sphere_plan_and_check_agree_that_it_is_one() -> None:
    """Whatever moment is the odd one."""
    text, off = case("near-sphere-2.yaml").read_text(), 3e-8
    line = next(one for one in text.splitlines() if one.startswith("inertia"))
    for odd in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 2, 1)):
        rows = np.diag([100.0 + off * one for one in odd]).tolist()
        sphere = read_spacecraft(text.replace(line, f"inertia: {{tensor: {rows}}}"), "near.yaml")
        assert (sphere.inertia.a, sphere.inertia.symmetric, sphere.inertia.shape) == (0.0, True, "sphere")
        assert math.isinf(sphere.body_period)
        assert checked_json("near.yaml", sphere)["spin_axis"]["class"] == "sphere"
        for scheme in CLASSIC:
            assert left_by(sphere, scheme) < 1e-9
    assert left_by(load_spacecraft(case("near-sphere-1.yaml")), "two-pulse") < 1e-9


@spread("scheme", [*CLASSIC, "half-cone", "rhumb-line"], quick=1)
@spread("off", [1e-15, 0.9e-9, 1.1e-9, 1e-12, 1e-8], quick=3)
def test_on_either_side_of_the_tolerance_every_scheme_answers(off: float, scheme: str) -> None:
    """The sphere within it; beyond it a body whose nutation takes years to turn in the body."""
    for first, second, third in ((1 + off, 1, 1), (1, 1 + 2 * off, 1 + off), (1, 1, 1 - off)):
        if off > rigid_body.DEGENERATE and first != second:
            continue  # no spin about an axis of the middle moment
        moments = 100.0 * first, 100.0 * second, 100.0 * third
        assert (Inertia(moments).a == 0.0) == (off <= rigid_body.DEGENERATE)
        for plain in (
            spinner(moments=moments, phase=math.pi, channels=cross(8.0)),
            spinner(moments=moments, phase=0.7, channels=cross(8.0), spin=-3.0),
            spinner(moments=moments, degrees=60.0, steerable=Steerable(20.0)),
        ):
            for spacecraft in (plain, aimed(plain, 10.0, 30.0)):
                with within(10_000_000):
                    made = planning.plan(spacecraft, scheme)
                    residual = made.flown
                assert (residual is None) == (infeasibility(made) != "")
                if residual is not None:
                    assert np.isfinite([residual.nutation, residual.momentum_shift, residual.axis_error]).all()


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
        one = planning.plan(random_body(seed), scheme)
        if one.flown is None:
            continue
        nutation, shift = left_by_reference(one)
        assert (one.flown.nutation, one.flown.momentum_shift) == pytest.approx((nutation, shift), abs=1e-9)
        # What the impulse sum misses of a width is of the order of what dissipation does within one turn.
        slow = abs(one.spacecraft.growth) * one.spacecraft.inertial_period
        assert present(one.residual).nutation == pytest.approx(nutation, abs=0.03 * slow * one.spacecraft.nutation)
        damped += one.flown.nutation < NEARLY_NOTHING
    assert damped >= 7


@pytest.mark.parametrize("C", [40.0, 80.0, 150.0])
@pytest.mark.parametrize("spin", [2.0, -2.0])
def test_a_walk_coasts_as_the_flight_does(C: float, spin: float) -> None:
    body, times = replace(spinner(100.0, C, spin, degrees=50.0), dissipation=12.0), np.linspace(0.0, 40.0, 9)
    rates, _ = propagation.flown(body, Schedule(), 40.0).motion(times)
    omegas = [ImpulseBuilder(body).omega_at(float(time)) for time in times]
    assert omegas == pytest.approx(rates[:, 0] + 1j * rates[:, 1], abs=1e-12)
    # The example of a course is in no flat spin at 345 s: 45.08° by its book.
    plain = spinner(2000.0, 1000.0, 2.0 * math.pi, 0.0)
    course = replace(plain, omega0=np.array([0.1, 0.0, 2.0 * math.pi]), dissipation=100.0)
    rates, _ = propagation.flown(course, Schedule(), 345.0).motion(np.array([345.0]))
    nutation = math.degrees(reference.nutation(course.inertia.moments, rates[0], 1.0))
    assert nutation == pytest.approx(45.08, abs=0.005)


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
    spans, integrate = list[float](), taylor.integrate

    def counted(*args: object, **named: object) -> object:
        spans.append(float(args[5]) - float(args[4]))  # type: ignore[arg-type]
        return integrate(*args, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(taylor, "integrate", counted)
    body = spinner(channels=jets(5.0, 3, 0.5), limits=Limits(horizon=400.0))
    assert planning.plan(replace(body, dissipation=300.0), scheme).feasible
    assert spans
    assert max(spans) < 0.501  # the longest pulse, and a little more for difference quotients


@pytest.mark.deep
def test_no_bound_is_claimed_under_dissipation(run: Run, plans_shared: None) -> None:
    """An oblate body damps itself: there are schedules below A|ω0|, and they are found."""
    command = "plan", "-v", str(case("oblate-dissipation.yaml")), "--scheme", "optimal"
    shown = run(*command).stdout
    check_text("dissipation.no-bound", "\n".join(line for line in shown.splitlines() if "least impulse" in line))
    (planned,) = json.loads(run(*command, "--json", "-").stdout)["plans"]
    assert planned["total_impulse_Nms"] < 0.65 * planned["least_impulse_Nms"]


@pytest.mark.deep
@pytest.mark.parametrize(("A", "C"), [(80.0, 120.0), (120.0, 80.0)], ids=["oblate", "prolate"])
def test_the_first_order_least_knows_dissipation(A: float, C: float) -> None:
    """Small angles: with κ the optimum waits (oblate) or hurries (prolate), and costs what the program says."""
    body = spinner(A, C, degrees=0.5, channels=jets(5.0, longest=0.5), limits=Limits(horizon=60.0))
    one = planning.plan(replace(body, dissipation=100.0), "optimal")
    bounds = present(one.pulses.bounds)
    assert bounds.first_order is not None
    assert bounds.rigorous is None
    assert one.pulses.total_impulse == pytest.approx(bounds.first_order, rel=0.01)
    assert (bounds.first_order < 0.6 * body.least_impulse) == (A < C)
    assert left_by_reference(one)[0] < 1e-9


@pytest.mark.weekly
def test_what_dissipation_takes_out_alone_leaves_pulses_that_can_be_commanded() -> None:
    """An oblate body, 30 time constants of horizon: the longer it waits, the less it costs, without end."""
    body = replace(spinner(80.0, 120.0, channels=jets(400.0, 3), limits=Limits(horizon=600.0)), dissipation=20.0)
    one = planning.plan(body, "optimal")
    assert present(one.flown, infeasibility(one)).nutation < NEARLY_NOTHING
    assert all(pulse.resolved for pulse in one.pulses)
    assert one.pulses.total_impulse < 1e-3 * body.least_impulse
    assert present(one.pulses.bounds).within < 300.0  # the least within as long as the search looks


@spread(
    ("name", "options", "status", "said"),
    [
        ("crash-hang-near-sphere-dissipation", (), 3, r"dissipation takes the nutation out before the channels.*? it"),
        ("crash-dissipation-near-sphere-overflow", (), 3, ""),
        ("crash-halfcone-trim-crash", (), 0, ""),
        ("crash-target-ideal-torquer-dissipation", ("--target", "5deg,0deg"), 0, ""),
        ("crash-dissipation-short", (), 0, r"the nutation grows.*? rough"),
    ],
    quick=2,
)
def test_files_that_went_wrong(run: Run, name: str, options: tuple[str, ...], status: int, said: str) -> None:
    """Near a sphere ω takes days to turn in the body, and dissipation minutes to take it out."""
    done = run("plan", "-v", str(case(f"{name}.yaml")), *options)
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
    assert "nan" not in done.stdout.split()
    sentence = present(re.search(said, " ".join(done.stdout.split())))
    if said:
        check_text(f"dissipation.{name.removeprefix('crash-')}", sentence.group())

"""Bodies that are not as the schemes' model has them: unequal moments, disturbances, drifting spin, nearly spheres."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import reference
from support.builders import aimed, channel, cross, spinner, transverse, within
from support.cases import spread
from support.feasible import left
from support.golden import check_text
from support.places import case

from nutdamp import flight
from nutdamp.files.check_json import checked_json
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import load_spacecraft, read_spacecraft
from nutdamp.physics import forced, inertia
from nutdamp.planning import plan
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schedule import channel_pulse
from nutdamp.schemes import CLASSIC, Options
from nutdamp.schemes.tools.impulse_builder import ImpulseBuilder
from nutdamp.schemes.tools.symmetric_model import model_of, steady_omega
from nutdamp.spacecraft import Disturbance, Inertia, Limits, Spacecraft, Steerable

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
DISTURBED = Options(with_disturbances=True)
NEARLY_NOTHING = math.radians(1e-7)


def body(*moments: float, steerable: bool = False) -> Spacecraft:
    changed = replace(EXAMPLE, inertia=Inertia((moments[0], moments[1], moments[2])))
    return replace(changed, channels=(), steerable=Steerable(20.0, 220.0, 1.0)) if steerable else changed


def under(*disturbances: Disturbance) -> Spacecraft:
    return replace(EXAMPLE, disturbances=disturbances)


def left_by(spacecraft: Spacecraft, scheme: str, options: Options | None = None) -> float:
    return left(plan(spacecraft, scheme, options)).nutation


# --- three different moments, dissipation ----------------------------------------------------------------------------


def test_the_model_turns_at_the_true_nutation_rate() -> None:
    """0.775 rad/s for 120, 100, 80 kg m² and 3 rad/s, which the mean (0.818) misses; of a symmetric body it is that."""
    spacecraft = replace(body(120.0, 100.0, 80.0), omega0=np.array([0.1, 0.05, 3.0]))
    assert model_of(spacecraft).body.inertia.a * 3.0 == pytest.approx(0.775, abs=5e-4)
    assert spacecraft.inertia.a * 3.0 == pytest.approx(0.818, abs=5e-4)
    assert model_of(EXAMPLE).body is EXAMPLE
    assert model_of(EXAMPLE).exact


@pytest.mark.parametrize("moments", [(123.0, 117.0, 80.0), (80.0, 84.0, 120.0), (120.0, 100.0, 80.0)])
@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse"])
def test_unequal_moments_are_trimmed_away(moments: tuple[float, ...], scheme: str) -> None:
    for steerable in (False, True):
        residual = left(plan(body(*moments, steerable=steerable), scheme))
        assert residual.nutation < NEARLY_NOTHING
        assert residual.momentum_shift < NEARLY_NOTHING or scheme == "one-pulse"


def test_a_plan_says_how_much_is_due_to_unequal_moments() -> None:
    """Ticks leave some nutation too, so that the three angles of the remark differ."""
    made = plan(replace(body(123.0, 117.0, 80.0), limits=Limits(tick=0.05)), "four-pulse")
    (said,) = [remark for remark in remarks(made) if "I1 ≠ I2" in remark]
    symmetric = replace(made.spacecraft, inertia=Inertia((120.0, 120.0, 80.0)))
    without, flown = flight.flown(symmetric, made.pulses).residual.nutation, left(made).nutation
    shares = [f"{math.degrees(angle):.3g}°" for angle in (abs(flown - without), flown, without)]
    assert len(set(shares)) == 3
    assert [word.strip(":,") for word in said.split() if "°" in word] == shares
    check_text("true.unequal", said)


@pytest.mark.parametrize("moments", [(120.0, 120.0, 80.0), (80.0, 80.0, 120.0)])
def test_dissipation_is_planned_for(moments: tuple[float, ...]) -> None:
    for scheme in ("one-pulse", "two-pulse"):
        damping = replace(body(*moments, steerable=True), dissipation=120.0)
        assert left_by(damping, scheme) < NEARLY_NOTHING
    growing = plan(replace(EXAMPLE, dissipation=60.0), "one-pulse")  # a train fires once more
    assert len(growing.pulses) > len(plan(EXAMPLE, "one-pulse").pulses)
    assert left(growing).nutation < NEARLY_NOTHING


# --- disturbances ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "disturbance",
    [Disturbance(0.3 + 0.1j), Disturbance(0.2j, rate=-EXAMPLE.spin), Disturbance(0.05 + 0j, rate=2.0)],
    ids=["constant", "space-fixed", "turning"],
)
def test_with_disturbances_only_their_steady_tilt_is_left(disturbance: Disturbance) -> None:
    spacecraft = under(disturbance)
    tilt = spacecraft.inertia.A * abs(steady_omega(spacecraft, 0.0)) / (spacecraft.inertia.C * spacecraft.spin)
    for scheme in CLASSIC:
        made, nominal = plan(spacecraft, scheme, DISTURBED), plan(spacecraft, scheme)
        assert left(made).nutation == pytest.approx(math.atan(tilt), rel=2e-3, abs=1e-9)
        assert any("steady tilt" in remark for remark in remarks(made))
        # Plans stay nominal unless disturbances are asked for.
        assert [pulse.t for pulse in nominal.pulses] == [pulse.t for pulse in plan(EXAMPLE, scheme).pulses]
        assert any("--with-disturbances" in remark for remark in remarks(nominal))


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
    moved = forced.rotating_torques(times, start, spacecraft.spin, shape.A, shape.C, *torque)
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
    edges = [0.0, pulse.start, pulse.end, 30.0]
    torques = [axial, axial + jet.torque, axial]

    def flown(end: float) -> complex:
        pushes = [reference.Push(*edge, T) for *edge, T in zip(edges, edges[1:], torques, strict=False)]
        return transverse(reference.fly(drifting.inertia.moments, drifting.omega0, pushes, end).rates)

    assert builder.omega_at(10.0) == pytest.approx(flown(10.0), rel=1e-10)
    builder.fire(pulse)
    for time in (pulse.end, 30.0):
        assert builder.omega_at(time) == pytest.approx(flown(time), rel=1e-10)
    assert builder.spin == pytest.approx(spin + 2.0 / drifting.inertia.C * 12.0, rel=1e-14)


# --- nearly spheres --------------------------------------------------------------------------------------------------


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
        if off > inertia.DEGENERATE and first != second:
            continue  # no spin about an axis of the middle moment
        moments = 100.0 * first, 100.0 * second, 100.0 * third
        assert (Inertia(moments).a == 0.0) == (off <= inertia.DEGENERATE)
        for plain in (
            spinner(moments=moments, phase=math.pi, channels=cross(8.0)),
            spinner(moments=moments, phase=0.7, channels=cross(8.0), spin=-3.0),
            spinner(moments=moments, degrees=60.0, steerable=Steerable(20.0)),
        ):
            for spacecraft in (plain, aimed(plain, 10.0, 30.0)):
                with within(10_000_000):
                    made = plan(spacecraft, scheme)
                    residual = made.flown
                assert (residual is None) == (infeasibility(made) != "")
                if residual is not None:
                    assert np.isfinite([residual.nutation, residual.momentum_shift, residual.axis_error]).all()

"""What a dispersed case is, against vector algebra for single cases; draws, their distributions and correlations."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.spatial.transform import Rotation
from scipy.stats import kstest, multivariate_normal, norm, triang, uniform
from support import dispersed
from support.builders import channel, spinner
from support.cases import deep
from support.golden import check_text, refused

from nutdamp.errors import BadRequest
from nutdamp.montecarlo.cases import DispersedModel, rotated, tilt_axes
from nutdamp.montecarlo.inputs import (
    BLOCK,
    DispersedInput,
    DrawSource,
    grouped,
    groups_of,
    list_inputs,
    mixing,
    normal_of,
    together,
    value_of,
)
from nutdamp.montecarlo.study import Results, Study, run
from nutdamp.physics.body import principal_axes
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Inertia
from nutdamp.spacecraft.schedule import Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance


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


def test_rotations_of_forces_and_of_the_attitude() -> None:
    for force in (np.array([0.0, 0.0, 5.0]), np.array([3.0, -4.0, 12.0])):
        axes = np.array([*tilt_axes(force), force / np.linalg.norm(force)])
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-15)
    vector, tilt = np.array([[1.0, 0.2], [-0.3, 0.5], [2.0, 3.0]]), np.array([[0.3, 0.0], [-0.4, 0.7]])
    expected = Rotation.from_rotvec(np.column_stack([*tilt, np.zeros(2)])).apply(vector.T)
    assert np.column_stack(rotated(tuple(vector), tuple(tilt))) == pytest.approx(expected, abs=1e-14)


def test_a_steerable_pulse_is_turned_in_the_1_2_plane() -> None:
    torquer = Steerable(20.0, 220.0, 0.8)
    made = Schedule((steerable_pulse(torquer, 1.0, 0.4, on_time=0.5),))
    cases = DispersedModel(spinner(steerable=torquer), made).cases(
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
        cases = DispersedModel(body, Schedule((fired,))).cases({name: 0.1})
        assert np.array(cases.impulses[0]) == pytest.approx([3.3, 1.1, 0.0])
        assert (cases.propellant is None) == (fired is unknown)


def test_rates_and_positions_are_in_the_axes_of_the_file() -> None:
    moments, axes = principal_axes(np.array([[120.0, 3.0, 0.0], [3.0, 110.0, 2.0], [0.0, 2.0, 80.0]]))
    jet = dispersed.jet("T1", (0.1, 0.3, 0.8), (0.0, -10.0, 1.0))  # in principal axes
    body = replace(spinner(moments=moments, channels=(Channel("T1", (jet,)),)), inertia=Inertia(moments, axes))
    model = DispersedModel(body, Schedule((channel_pulse(body.channels[0], 1.0, 0.5),)))
    cases = model.cases({"omega0_1": 0.01, "omega0_3": 0.02, "position T1 y": 0.05, "A": 0.01 * body.inertia.A})
    assert np.array(cases.omega0) == pytest.approx(body.omega0 + axes.T @ [0.01, 0.0, 0.02])
    more = 0.5 * np.cross(axes.T @ [0.0, 0.05, 0.0], [0.0, -10.0, 1.0])
    assert np.array(cases.impulses[0]) == pytest.approx(0.5 * jet.torque + more)
    # A scales both transverse moments, and is their mean.
    assert np.array(cases.moments) == pytest.approx([1.01 * moments[0], 1.01 * moments[1], moments[2]])
    assert float(cases.A) == pytest.approx(0.505 * (moments[0] + moments[1]))


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
    # Relative sizes are shares of the nominal value.
    relative = Dispersions(A=Tolerance("normal", 0.02, True), omega0=(None, None, Tolerance("bias", 0.01, True)))
    inputs = list_inputs(replace(spinner(A=120.0, spin=-3.0), dispersions=relative), Schedule())
    sizes = {entry.name: (entry.size, entry.sigma) for entry in inputs.drawn}
    assert sizes == {"A": pytest.approx((2.4, 2.4)), "omega0_3": pytest.approx((-0.03, 0.0))}


LAWS = {"normal": norm(scale=2.0), "uniform": uniform(-2.0, 4.0), "triangular": triang(0.5, -2.0, 4.0)}
"""Of inputs of size 2."""

Pair = tuple[str, str, float]


def an_input(name: str = "A", kind: str = "normal", size: float = 1.0) -> DispersedInput:
    return DispersedInput(name, name, kind, size, 100.0, "kg m²")


def drawn(
    *inputs: DispersedInput, pairs: tuple[Pair, ...] = (), seed: int = 1, block: int = 0
) -> dict[str, np.ndarray]:
    draws, _ = DrawSource(inputs, seed, lambda _: True, groups_of(pairs)).block(block)
    return {name: np.asarray(draw) for name, draw in draws.items()}


@pytest.mark.parametrize(("kind", "excess"), [("normal", 0.0), ("uniform", -1.2), ("triangular", -0.6)])
def test_draws_have_the_moments_of_their_kind(kind: str, excess: float) -> None:
    entry = an_input(kind=kind, size=2.0)
    values = np.concatenate([drawn(entry, block=block)["A"] for block in range(12)])
    assert abs(values.mean()) < 4.0 * entry.sigma / np.sqrt(len(values))
    assert values.std() == pytest.approx(entry.sigma, rel=0.01)
    assert ((values / entry.sigma) ** 3).mean() == pytest.approx(0.0, abs=0.03)
    assert ((values / entry.sigma) ** 4).mean() - 3.0 == pytest.approx(excess, abs=0.06)
    assert kind == "normal" or 1.9 < np.abs(values).max() <= 2.0
    assert DrawSource((an_input(kind="bias", size=-0.3),), 1, lambda _: True).block(0)[0] == {"A": -0.3}


def test_neighbours_are_independent() -> None:
    """Inputs, blocks and seeds: correlations of 16,384 numbers stay within four times their scatter."""
    both = an_input("A"), an_input("C")
    rows = [*drawn(*both).values(), drawn(*both, block=1)["A"], drawn(*both, seed=2)["A"]]
    assert np.abs(np.corrcoef(rows) - np.eye(4)).max() < 4.0 / np.sqrt(BLOCK)


def test_other_tolerances_do_not_change_the_draws_of_one() -> None:
    """So two studies of which one has a tighter tolerance see the same cases otherwise."""
    others = an_input("A", "uniform", 5.0), an_input("C", size=2.0), an_input("x", "bias")
    assert np.array_equal(2.0 * drawn(an_input("C"), block=3)["C"], drawn(*others, block=3)["C"])


def test_what_cannot_be_is_drawn_again_and_reported() -> None:
    """Values above one sigma are refused: 15.87 % are drawn again, of those again 15.87 % and so on."""
    draws, redrawn = DrawSource([an_input()], 1, lambda draws: np.asarray(draws["A"]) <= 1.0).block(0)
    values, free = np.array(draws["A"]), drawn(an_input())["A"]
    kept = free <= 1.0
    assert values.max() <= 1.0
    assert len(redrawn) == pytest.approx(BLOCK * 0.15866 / (1.0 - 0.15866), rel=0.05)
    assert np.array_equal(values[kept], free[kept])
    assert set(np.flatnonzero(~kept)) == set(redrawn.tolist())
    # A normal cut at one sigma has the mean -φ(1)/Φ(1).
    assert values.mean() == pytest.approx(-0.24197 / 0.84134, abs=0.02)
    again = DrawSource([an_input()], 1, lambda draws: np.asarray(draws["A"]) <= 1.0)
    again.block(5)
    assert np.array_equal(values, again.block(0)[0]["A"])
    nothing = DrawSource([an_input()], 1, lambda draws: np.zeros(len(np.asarray(draws["A"])), dtype=bool))
    with refused(BadRequest, "montecarlo.nothing-possible"):
        nothing.block(0)


def test_normal_draws_have_the_correlation_and_the_others_stay_to_the_last_bit() -> None:
    inputs = [an_input(name, size=size) for name, size in zip("ABCD", (1.0, 2.0, 0.1, 3.0), strict=True)]
    plain = drawn(*inputs)
    correlated = drawn(*inputs, pairs=(("A", "B", 0.9), ("B", "C", -0.4)))
    expected = [[1.0, 0.9, 0.0, 0.0], [0.9, 1.0, -0.4, 0.0], [0.0, -0.4, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    assert np.corrcoef(list(correlated.values())) == pytest.approx(np.array(expected), abs=4.0 / math.sqrt(BLOCK))
    for name in "AD":  # the first of a group, and what is in none
        assert np.array_equal(correlated[name], plain[name])
    for entry in inputs:
        assert kstest(correlated[entry.name] / entry.size, norm.cdf).pvalue > 1e-3


@pytest.mark.parametrize("kinds", list(itertools.combinations_with_replacement(LAWS, 2)))
def test_each_keeps_its_distribution_and_the_correlation_of_values_is_known(kinds: tuple[str, str]) -> None:
    """The share of cases with both above a level is that of the bivariate normal law, which the copula is."""
    inputs = [an_input(name, kind, 2.0) for name, kind in zip("AB", kinds, strict=True)]
    pairs = (("A", "B", 0.8),)
    values = np.hstack([list(drawn(*inputs, pairs=pairs, seed=seed).values()) for seed in range(1, 9)])
    laws = [LAWS[kind] for kind in kinds]
    for law, value in zip(laws, values, strict=True):
        assert kstest(value, law.cdf).pvalue > 1e-3
    both = (values[0] > laws[0].ppf(0.7)) & (values[1] > laws[1].ppf(0.7))
    expected = multivariate_normal(cov=[[1.0, 0.8], [0.8, 1.0]]).cdf([norm.ppf(0.3)] * 2)
    assert both.mean() == pytest.approx(expected, abs=0.006)
    matrix = mixing(inputs, grouped(pairs))
    assert (matrix @ matrix.T)[0, 1] == pytest.approx(np.corrcoef(values)[0, 1], abs=0.01)


@pytest.mark.parametrize("kinds", [("uniform", "uniform"), ("normal", "uniform"), ("uniform", "triangular")])
def test_the_correlation_of_values_is_the_integral_over_both(kinds: tuple[str, str]) -> None:
    inputs, rho = [an_input(name, kind) for name, kind in zip("AB", kinds, strict=True)], -0.6
    for entry in inputs:  # normals and values are inverse
        normals = np.linspace(-5.0, 5.0, 101)
        assert normal_of(entry, value_of(entry, normals)) == pytest.approx(normals, abs=1e-9)

    def integrand(y: float, x: float) -> float:
        other = rho * x + math.sqrt(1.0 - rho**2) * y
        product = value_of(inputs[0], np.array(x)) * value_of(inputs[1], np.array(other))
        return float(product) * math.exp(-0.5 * (x * x + y * y)) / (2.0 * math.pi)

    integral, _ = dblquad(integrand, -7.0, 7.0, -7.0, 7.0, epsabs=1e-6, epsrel=1e-6)
    matrix = mixing(inputs, grouped([("A", "B", rho)]))
    assert (matrix @ matrix.T)[0, 1] == pytest.approx(integral / (inputs[0].sigma * inputs[1].sigma), abs=1e-4)


def test_which_others_are_drawn_makes_no_difference() -> None:
    """A case is the same body for every schedule, whichever thrusters it fires."""
    pairs = (("thrust T1", "A", 0.5), ("thrust T2", "thrust T1", 0.7))
    whole = drawn(*map(an_input, ("A", "thrust T1", "thrust T2")), pairs=pairs)
    for name in ("A", "thrust T2"):
        assert np.array_equal(drawn(an_input(name), pairs=pairs)[name], whole[name])


def test_a_case_drawn_again_is_correlated_too() -> None:
    groups = groups_of([("A", "B", 0.95)])
    source = DrawSource([an_input("A"), an_input("B")], 1, lambda draws: np.asarray(draws["A"]) > 0.0, groups)
    draws, redrawn = source.block(0)
    assert len(redrawn) > BLOCK // 2
    residual = np.asarray(draws["B"]) - 0.95 * np.asarray(draws["A"])
    assert residual.mean() == pytest.approx(0.0, abs=0.01)
    assert residual.std() == pytest.approx(math.sqrt(1.0 - 0.95**2), rel=0.02)


def test_correlations_make_groups_or_are_refused() -> None:
    assert [group.names for group in groups_of([("A", "B", 0.9), ("D", "E", 0.1)])] == [("A", "B"), ("D", "E")]
    with refused(BadRequest, "montecarlo.impossible-correlation"):
        groups_of((("A", "B", 0.9), ("B", "C", 0.9), ("A", "C", -0.5)))


@pytest.mark.parametrize("rho", [0.95, deep(-0.95), deep(0.0)])
def test_the_budget_of_a_pair_is_the_variance_of_what_both_do_together(rho: float) -> None:
    """Of A and C with one relative size, most cancels where they are correlated: the motion knows only C/A."""
    model = dispersed.exact_two_pulse(0.02).model
    assert model.spacecraft.dispersions is not None
    tolerances = replace(model.spacecraft.dispersions, correlation=(("C", "A", rho),))
    study = Study(DispersedModel(replace(model.spacecraft, dispersions=tolerances), model.schedule), seed=3)
    results, first = run(Results(study, BLOCK)), study.first_order
    names = [entry.name for entry in first.inputs]
    pair = [names.index(name) for name in "AC"]
    effects = first.jacobian[:2, pair] * first.sigmas[pair]  # what one sigma of each does to the nutation
    variance = (effects**2).sum() + 2.0 * rho * (effects[:, 0] @ effects[:, 1])
    others = (first.effects("nutation")[[row for row in range(len(names)) if row not in pair]] ** 2).sum()
    share = variance / (variance + others)
    assert first.shares("nutation")[pair].sum() == pytest.approx(share, rel=1e-9)
    assert first.shares("nutation").sum() == pytest.approx(1.0, rel=1e-12)
    assert sum(results.shares[name]["nutation"] for name in "AC") == pytest.approx(share, abs=0.03)
    vectors = results.early[:2, : results.done]
    assert np.sqrt(vectors.var(axis=1).sum()) == pytest.approx(first.sigma("nutation"), rel=0.03)
    assert together(first.inputs, study.model.groups)[0] == pair[::-1]

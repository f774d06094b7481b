"""Records that a fit could explain wrongly, with small sigmas: it refuses them, or says what it rests on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support import reference
from support.cases import spread
from support.synthetic import Array, motion

import nutdamp
from nutdamp.errors import Infeasible
from nutdamp.estimation.doubts import doubts
from nutdamp.estimation.fit import fit
from nutdamp.estimation.record import GYROS, Record
from nutdamp.estimation.results import estimates

NOISE = math.radians(0.01)
SPIN = math.pi


def record(times: Array, C: float, *, gyros: tuple[str, ...] = GYROS, spin: float = SPIN) -> Record:
    """Gyros of the example with another C."""
    rates = motion((120.0, 120.0, C), np.array([0.14, 0.12, spin]), times)
    rates = rates + NOISE * np.random.default_rng(16).normal(size=rates.shape)
    return Record(times, {name: rates[:, GYROS.index(name)] for name in gyros})


WIDE = {"A": {"normal": "30 %"}, "C": {"normal": "30 %"}}


@pytest.mark.deep
@pytest.mark.parametrize("gyros", [GYROS, ("omega_2", "omega_3")])
def test_nutation_rates_that_sampling_cannot_tell_apart_are_all_named(gyros: tuple[str, ...]) -> None:
    """C/A 0.775 sampled every 10 s looks like any that differs by a multiple of 0.2, as its rate does by 2π/10 s."""
    body = nutdamp.example().with_(dispersions=WIDE)
    with pytest.raises(Infeasible, match=r"several nutation rates fit equally well: .* 0\.5750, .*0\.7750, .*0\.9750"):
        fit(body, record(np.linspace(0.0, 600.0, 61), 93.0, gyros=gyros))


@pytest.mark.deep
def test_nutation_rates_none_of_which_the_file_allows_are_refused() -> None:
    with pytest.raises(Infeasible, match="none of their C/A is as near to the file"):
        fit(nutdamp.example(), record(np.linspace(0.0, 600.0, 61), 93.0))


@pytest.mark.deep
def test_sampling_at_uneven_times_tells_them_apart() -> None:
    times = np.linspace(0.0, 600.0, 61) + np.random.default_rng(1).uniform(-1.0, 1.0, 61)
    found = fit(nutdamp.example().with_(dispersions=WIDE), record(times - times[0], 93.0))
    assert found.named["C/A"] == pytest.approx(0.775, abs=4.0 * found.sigmas[found.index("C/A") or 0])


@pytest.mark.deep
def test_a_tolerance_that_leaves_one_rate_is_said_to_decide() -> None:
    found = fit(nutdamp.example(), record(np.linspace(0.0, 600.0, 61), 80.4))
    assert found.named["C/A"] == pytest.approx(0.67, abs=2e-4)
    assert any("sampled below the nutation rate" in one for one in doubts(found))
    found = fit(nutdamp.example(), record(np.linspace(0.0, 120.0, 121), 80.4))
    assert not list(doubts(found))


def pushed(thrust: float) -> Record:
    """A minute of 10 Hz gyros of a body that +M2 pushes for 0.5 s at 20 s, with ``thrust`` N m."""
    moments, times = (120.0, 120.0, 80.4), np.linspace(0.0, 60.0, 601)
    now, rates = reference.Motion(np.array([0.14, 0.12, SPIN]), np.eye(3)), [np.array([0.14, 0.12, SPIN])]
    for begin, end, torque in ((0, 200, 0.0), (200, 205, thrust), (205, 600, 0.0)):
        motions = reference.coast(moments, now, np.array([0.0, torque, 0.0]), times[1 : end - begin + 1])
        rates += [one.rates for one in motions]
        now = motions[-1]
    noisy = np.array(rates) + NOISE * np.random.default_rng(16).normal(size=(601, 3))
    return Record(times, dict(zip(GYROS, noisy.T, strict=True)))


@spread("thrust", [8.0, 1.0], quick=1)
def test_a_pulse_that_no_schedule_names_is_found_and_nothing_is_estimated(thrust: float) -> None:
    with pytest.raises(Infeasible, match=r"with a step at about (19\.|20\.|21\.).* --schedule"):
        fit(nutdamp.example(), pushed(thrust))


def test_of_a_pulse_that_hides_in_the_noise_the_time_and_what_helps_are_said() -> None:
    found = fit(nutdamp.example(), pushed(0.06))
    said = next(one for one in doubts(found) if "not white" in one)
    time = float(said.split("at about ")[1].split()[0])
    assert abs(time - 20.25) < 1.5
    assert "give the pulses fired with --schedule, or end the record before it" in said
    assert not any("white" in one for one in doubts(fit(nutdamp.example(), pushed(0.0))))


def test_a_spin_the_other_way_than_in_the_file_is_doubted_and_its_nutation_counts_from_its_own_sense() -> None:
    found = fit(nutdamp.example(), record(np.linspace(0.0, 60.0, 601), 80.4, spin=-SPIN))
    nutation = next(one for one in estimates(found, 0.0) if one.key == "nutation")
    expected = math.atan2(120.0 * math.hypot(0.14, 0.12), 80.4 * SPIN)
    assert nutation.value == pytest.approx(expected, abs=4.0 * nutation.sigma)
    assert any("spins the other way than the file has it" in one for one in doubts(found))


@pytest.mark.deep
def test_of_three_moments_the_largest_nutation_is_named_so() -> None:
    body = nutdamp.load(
        {"name": "three", "inertia": {"tensor": [[120, 0, 0], [0, 110, 0], [0, 0, 80]]}, "omega0": [0.1, 0.1, SPIN]}
    )
    times = np.linspace(0.0, 60.0, 601)
    rates = motion((120.0, 110.0, 80.0), np.array([0.14, 0.12, SPIN]), times)
    rates = rates + NOISE * np.random.default_rng(16).normal(size=rates.shape)
    found = fit(body, Record(times, dict(zip(GYROS, rates.T, strict=True))))
    row = next(one for one in estimates(found, 0.0) if one.key == "nutation")
    assert row.label == "largest nutation"
    momentum = rates * np.array([120.0, 110.0, 80.0])
    largest = np.arctan2(np.hypot(momentum[:, 0], momentum[:, 1]), momentum[:, 2]).max()
    assert row.value == pytest.approx(largest, abs=1e-3)


def test_too_few_values_and_no_transverse_signal_are_said() -> None:
    with pytest.raises(Infeasible, match="1 row of samples, with 3 values in all, cannot tell 4 unknowns"):
        fit(nutdamp.example(), Record(np.zeros(1), dict.fromkeys(GYROS, np.ones(1))))
    with pytest.raises(Infeasible, match="no nutation is seen in omega_3 alone"):
        fit(nutdamp.example(), record(np.linspace(0.0, 60.0, 61), 80.4, gyros=GYROS[2:]))

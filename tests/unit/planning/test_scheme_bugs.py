"""A scheme with a bug takes no other scheme down."""

from __future__ import annotations

import pytest
from support.builders import channel, cross, spinner

from nutdamp import schemes, velocity_change
from nutdamp.comparison import compare
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Schedule


def test_a_bug_of_one_scheme_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    from nutdamp.schemes import two_pulse

    def broken(*_: object) -> Schedule:
        raise ZeroDivisionError("float division by zero")

    body = spinner(channels=cross(20.0))
    whole = compare(body, schemes.CLASSIC)
    monkeypatch.setattr(two_pulse, "schedule", broken)
    compared = compare(body, schemes.CLASSIC)
    (failed,) = compared.failed
    assert failed.scheme == "two-pulse"
    assert infeasibility(failed) == "internal error, please report: ZeroDivisionError"
    assert isinstance(failed.failure, ZeroDivisionError)
    for one, other in zip(compared.plans, whole.plans, strict=True):
        assert one.scheme == "two-pulse" or one.pulses.total_impulse == other.pulses.total_impulse
    assert compared.recommended is not None


def test_a_bug_that_shows_when_the_plan_is_judged_counts_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> object:
        raise IndexError("list index out of range")

    monkeypatch.setattr(velocity_change, "momentum_gained", broken)
    jet = channel("T", 0.0, 8.0, 0.0, isp=220.0, thrust=10.0, force=(10.0, 0.0, 0.0))
    compared = compare(spinner(channels=(jet,), mass=100.0), ("one-pulse",))
    assert [infeasibility(one) for one in compared.failed] == ["internal error, please report: IndexError"]
    assert compared.recommended is None


def test_what_a_user_can_cure_is_no_bug() -> None:
    with pytest.raises(KeyError):
        compare(spinner(), ("two-pulse", "five-pulse"))

"""Flights of many sequences at once: all stretches together are what they are in turn."""

import numpy as np
import pytest
from support.builders import channel, cross, spinner
from support.three_moments import unequal_body

from nutdamp.physics import attitude
from nutdamp.schemes.optimal.descent import Task
from nutdamp.schemes.optimal.refinement import EndEquations
from nutdamp.spacecraft.equipment import Channel

LEANING = (*cross(8.0), channel("lean", 3.0, 4.0, 1.5))
"""Channels of which one changes the spin."""


@pytest.mark.parametrize("channels", [cross(8.0), LEANING])
@pytest.mark.parametrize("kicks", [0, 1, 24])
def test_all_stretches_at_once_are_those_in_turn(channels: tuple[Channel, ...], kicks: int) -> None:
    task = Task(spinner(channels=channels), EndEquations(), channels, np.ones(len(channels)))
    draw = np.random.default_rng(1)
    which = draw.integers(len(channels), size=(9, 5))
    x = np.hstack(
        [3.0 * np.arange(5) + draw.uniform(0.0, 1.0, (9, 5)), draw.uniform(0.0, 1.8, (9, 5))]
    )
    (momentum, turn), (expected, turned) = (
        task._together(which, x, kicks),
        task._in_turn(which, x, kicks),
    )
    size = np.abs(expected).max()
    assert np.abs(momentum - expected).max() < 1e-13 * size
    there, here = (attitude.rotate(q.T, h.T) for q, h in ((turn, momentum), (turned, expected)))
    assert np.abs(there - here).max() < 1e-13 * size
    unequal = Task(unequal_body(1)[0], EndEquations(), channels, np.ones(len(channels)))
    for each in (task, unequal):
        assert each.misses(which[:0], x[:0], kicks).shape == (0, len(EndEquations().chosen))

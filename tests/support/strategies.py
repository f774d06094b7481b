"""Strategies of hypothesis: spinning bodies and schedules."""

import math

import numpy as np
from hypothesis import strategies as st
from support.builders import pulse, spinner

from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

UNTIL = 12.0
"""End, s, of the flights of `schedules`."""

angles = st.floats(-math.pi, math.pi)
spins = st.floats(0.5, 3.0) | st.floats(-3.0, -0.5)


@st.composite
def symmetric_spinners(draw: st.DrawFn) -> Spacecraft:
    a = draw(st.floats(-1.0, 0.9) | st.sampled_from([0.0, 1e-6, -1e-6, -1.0]))
    degrees = draw(st.floats(0.1, 80.0))
    return spinner(100.0, 100.0 * (1 - a), draw(spins), degrees, draw(angles))


@st.composite
def triaxial_spinners(draw: st.DrawFn) -> Spacecraft:
    """Triangle inequality kept: I1 = y² + z² and round of a mass distribution."""
    x, y, z = (draw(st.floats(30.0, 80.0)) for _ in range(3))
    return spinner(
        spin=draw(spins),
        degrees=draw(st.floats(0.1, 60.0)),
        phase=draw(angles),
        moments=(y + z, z + x, x + y),
    )


@st.composite
def schedules(draw: st.DrawFn, *, ideal: bool = False, axial: bool = True) -> Schedule:
    """Up to five pulses of different channels, which may overlap and be of any width."""
    pulses = []
    for index in range(draw(st.integers(0, 5))):
        on_time = 0.0 if ideal else draw(st.sampled_from([0.0, 0.01]) | st.floats(0.05, 3.0))
        t = draw(st.floats(0.5 * on_time, UNTIL - 0.5 * on_time))
        impulse = [draw(st.floats(-40.0, 40.0)) for _ in range(2)] + [
            draw(st.floats(-60.0, 60.0)) if axial else 0.0
        ]
        pulses.append(pulse(t, on_time, np.array(impulse), f"T{index}"))
    return Schedule(tuple(pulses))

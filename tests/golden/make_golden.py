"""Makes golden.json: schedules specified by hand, flown by the reference integrator alone.

    python tests/golden/make_golden.py

Nothing of nutdamp takes part. Each case gives a body, its motion at t = 0, and its pulses; the result is the motion
at the end of the last pulse, in the frame N: rates, attitude, H, nutation angle and shift of H.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import NamedTuple

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from support import reference
from support.reference import Kick, Push, vector

FILE = Path(__file__).with_name("golden.json")


class Case(NamedTuple):
    """Principal moments kg m², rates rad/s, and what is fired."""

    moments: tuple[float, float, float]
    rates: tuple[float, float, float]
    events: tuple[Push | Kick, ...]


def push(start: float, end: float, *torque: float) -> Push:
    """N m between two moments, s."""
    return Push(start, end, vector(*torque))


def kick(t: float, *impulse: float) -> Kick:
    """N m s at a moment, s."""
    return Kick(t, vector(*impulse))


PROLATE, OBLATE, NEEDLE = (120.0, 120.0, 80.0), (80.0, 80.0, 120.0), (239.0, 239.0, 6.01)

CASES = {
    "prolate, three impulses": Case(
        PROLATE, (0.12, 0.05, 3.0), (kick(0.4, -6, 2, 0), kick(1.9, 3, -5, 0), kick(3.3, 0, 4, 0))
    ),
    "oblate, spin reversed, three impulses": Case(
        OBLATE, (0.3, -0.2, -3.0), (kick(0.0, -6, 2, 0), kick(1.9, 3, -5, 0), kick(3.3, 0, 4, 0))
    ),
    "prolate, wide pulses": Case(
        PROLATE, (0.12, 0.05, 3.0), (push(0.5, 1.3, -8, 0, 0), push(2.0, 3.6, 0, 6, 0), push(5.0, 5.1, 20, 20, 0))
    ),
    "oblate, overlapping pulses": Case(
        OBLATE, (0.3, -0.2, 2.0), (push(0.5, 2.5, -8, 0, 0), push(1.5, 3.0, 0, 6, 0), push(2.0, 4.0, 3, 3, 0))
    ),
    "sphere, wide pulse": Case((100.0, 100.0, 100.0), (0.5, 0.1, -2.0), (push(1.0, 4.0, 9, -7, 0),)),
    "flat disc, impulse and pulse": Case(
        (100.0, 100.0, 200.0), (0.4, 0.4, 1.5), (kick(0.7, 10, -20, 0), push(2.0, 2.9, -15, 5, 0))
    ),
    "prolate, axial torques through spin reversal": Case(
        PROLATE, (0.2, -0.1, 1.0), (push(0.5, 2.5, 5, 2, -50), kick(4.0, 1, 1, -40), push(5.0, 7.0, -3, 4, 10))
    ),
    "needle near 60 degrees": Case(
        NEEDLE, (0.18, 0.02, 4.2), (push(1.0, 1.4, 0, -30, 0.2), push(6.0, 6.4, 25, 0, -0.1))
    ),
    "three different moments, coast and pulses": Case(
        (120.0, 100.0, 80.0),
        (0.3, 0.2, 2.5),
        (push(2.0, 2.8, -10, 5, 0), kick(6.0, 3, -2, 1), push(9.0, 11.0, 2, 2, 2)),
    ),
    "three different moments, tumbling": Case(
        (90.0, 150.0, 70.0), (1.5, 0.3, 0.4), (push(1.0, 3.0, 5, -20, 8), kick(8.0, 10, 10, -10))
    ),
}


def fly(case: Case) -> dict[str, object]:
    """The numbers of one case, with the input they belong to."""
    rates = vector(*case.rates)
    rotation = reference.frame_n(case.moments, rates)
    end = max(event.t if isinstance(event, Kick) else event.end for event in case.events)
    motion = reference.fly(case.moments, rates, case.events, end, rotation)
    before, after = (reference.momentum(case.moments, one) for one in (reference.Motion(rates, rotation), motion))
    return {
        "moments_kgm2": case.moments,
        "rates_rad_s": case.rates,
        "pulses": [
            {"t_s": event.t, "impulse_Nms": event.impulse.tolist()}
            if isinstance(event, Kick)
            else {"start_s": event.start, "end_s": event.end, "torque_Nm": event.torque.tolist()}
            for event in case.events
        ],
        "end_s": end,
        "end_rates_rad_s": motion.rates.tolist(),
        "end_rotation": np.round(motion.rotation, 14).tolist(),
        "momentum_Nms": after.tolist(),
        "nutation_rad": reference.nutation(case.moments, motion.rates, math.copysign(1.0, rates[2])),
        "momentum_shift_rad": reference.angle(before, after),
    }


def main() -> None:
    """Write all cases."""
    text = json.dumps({name: fly(case) for name, case in CASES.items()}, indent=1, ensure_ascii=False)
    FILE.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

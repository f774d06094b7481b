"""Writes the results in golden.json anew: its schedules, specified by hand, flown by the reference
integrator alone.

    python tests/golden/make_golden.py

Nothing of nutdamp takes part. Each case of the file gives a body, its motion at t = 0, and its
pulses; the results are the motion at the end of the last pulse, in the frame N: rates, attitude, H,
nutation angle and shift of H.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from support import reference

FILE = Path(__file__).with_name("golden.json")


def event(pulse: dict[str, Any]) -> reference.Push | reference.Kick:
    """An impulse (N m s) at a moment, or a torque (N m) between two."""
    if "impulse_Nms" in pulse:
        return reference.Kick(pulse["t_s"], np.array(pulse["impulse_Nms"], dtype=float))
    return reference.Push(
        pulse["start_s"], pulse["end_s"], np.array(pulse["torque_Nm"], dtype=float)
    )


def fly(case: dict[str, Any]) -> dict[str, Any]:
    """The results of one case: principal moments kg m², rates rad/s, and what is fired."""
    moments = case["moments_kgm2"]
    rates = np.array(case["rates_rad_s"], dtype=float)
    start = reference.Motion(rates, reference.frame_n(moments, rates))
    events = [event(pulse) for pulse in case["pulses"]]
    end = max(one.t if isinstance(one, reference.Kick) else one.end for one in events)
    motion = reference.fly(moments, rates, events, end, start.rotation)
    before, after = (reference.momentum(moments, one) for one in (start, motion))
    return {
        "end_s": end,
        "end_rates_rad_s": motion.rates.tolist(),
        "end_rotation": np.round(motion.rotation, 14).tolist(),
        "momentum_Nms": after.tolist(),
        "nutation_rad": reference.nutation(moments, motion.rates, math.copysign(1.0, rates[2])),
        "momentum_shift_rad": reference.angle(before, after),
    }


def main() -> None:
    """Write all cases."""
    cases = json.loads(FILE.read_text(encoding="utf-8"))
    flown = {name: case | fly(case) for name, case in cases.items()}
    FILE.write_text(json.dumps(flown, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

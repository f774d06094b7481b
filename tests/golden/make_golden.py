"""Writes what tests compare with anew: ``python tests/golden/make_golden.py NAME``.

``golden``, golden.json: its schedules, specified by hand, flown by the reference integrator alone.
Each case of the file gives a body, its motion at t = 0, and its pulses; the results are the motion
at the end of the last pulse, in the frame N: rates, attitude, H, nutation angle and shift of H.

``rivals``, rivals.json: what the independent search of support/rivals.py finds for 300 layouts of
strong thrusters, in some ten minutes of processor time. Each row is the cheapest schedule found for
one layout: cost in kg (null: none), pulses as channel, start, on-time.

``sun``, sun.csv: where the Sun is seen, by ERFA (pip install pyerfa), whose theory errs by some
milliarcseconds: days since J2000.0 (TT) and the geocentric direction of the Sun in the celestial
reference frame, with aberration.

``picture``, acceptance.png, the picture in the README: the schemes of the built-in example. But for
this one nothing of nutdamp's planning takes part.
"""

import json
import math
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from support import reference

FOLDER = Path(__file__).parent
FILE = FOLDER / "golden.json"
DAYS = np.arange(-10227.0, 36525.0, 467.53)
"""Days at which the Sun is seen: 1972 to 2100."""


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


def golden() -> None:
    """Write all cases."""
    cases = json.loads(FILE.read_text(encoding="utf-8"))
    flown = {name: case | fly(case) for name, case in cases.items()}
    FILE.write_text(json.dumps(flown, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def rival(seed: int) -> dict[str, Any]:
    """The row of one layout, of 30 random starts."""
    search = import_module("support.rivals")
    best = search.cheapest(*search.strong_layout(seed), starts=30, seed=seed)
    if best is None:
        return {"seed": seed, "cost_kg": None}
    return {
        "seed": seed,
        "cost_kg": best.cost,
        "pulses": [pulse for pulse in best.pulses if pulse[2] > 0.0],
    }


def rivals() -> None:
    """Search all layouts."""
    with ProcessPoolExecutor() as pool:
        rows = ",\n".join(map(json.dumps, pool.map(rival, range(300))))
    (FOLDER / "rivals.json").write_text(f"[\n{rows}\n]\n", encoding="utf-8")


def sun() -> None:
    """Ask ERFA for the Sun."""
    erfa = import_module("erfa")
    lines = ["days,x,y,z"]
    for days in DAYS.tolist():
        heliocentric, barycentric = erfa.epv00(2451545.0, days)
        distance = float(np.linalg.norm(heliocentric["p"]))
        velocity = barycentric["v"] * erfa.DAU / erfa.DAYSEC / erfa.CMPS
        x, y, z = erfa.ab(
            -heliocentric["p"] / distance,
            velocity,
            distance,
            float(np.sqrt(1.0 - velocity @ velocity)),
        ).tolist()
        lines.append(f"{days:.2f},{x:.9f},{y:.9f},{z:.9f}")
    (FOLDER / "sun.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def picture() -> None:
    """Draw the acceptance box of the built-in example, in a folder where no spacecraft.yaml is."""
    command = (sys.executable, "-m", "nutdamp", "plan")
    drawing = ("--plot", str(FOLDER / "acceptance.png"), "--figure", "box")
    with TemporaryDirectory() as empty:
        subprocess.run([*command, *drawing], cwd=empty, check=True)


if __name__ == "__main__":
    {"golden": golden, "rivals": rivals, "sun": sun, "picture": picture}[sys.argv[1]]()

"""Writes sun.csv: where the Sun is seen, by ERFA (pip install pyerfa), whose theory errs by some
milliarcseconds.

Days since J2000.0 (TT) and the geocentric direction of the Sun in the celestial reference frame,
with aberration.
"""

from importlib import import_module
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("sun.csv")
DAYS = np.arange(-10227.0, 36525.0, 467.53)
"""1972 to 2100."""

if __name__ == "__main__":
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
    FILE.write_text("\n".join(lines) + "\n", encoding="utf-8")

"""A spacecraft whose principal axes are not those of its file, as a file and as a dict."""

from typing import Any

import numpy as np

TILTED = """
name: Tilted
inertia: {tensor: [[120, 3, 6], [3, 118, -4], [6, -4, 80]]}
omega0: [0.2, 0.1, 3.0]
steerable: {torque: 40 N m, isp: 220 s, lever_arm: 1 m}
requirement: {nutation: 0.5 deg}
"""

KEYS: dict[str, Any] = {
    "name": "Tilted",
    "inertia": {"tensor": np.array([[120, 3, 6], [3, 118, -4], [6, -4, 80]])},
    "omega0": (0.2, np.float64(0.1), 3.0),
    "steerable": {"torque": "40 N m", "isp": "220 s", "lever_arm": "1 m"},
    "requirement": {"nutation": "0.5 deg"},
    "limits": {"horizon": "100 s", "max_pulses": np.int64(3)},
}

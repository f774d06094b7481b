"""The track of a flight as CSV."""

from __future__ import annotations

import numpy as np

from nutdamp.files.frames import file_axes
from nutdamp.files.output import csv_text, number
from nutdamp.spacecraft import Inertia
from nutdamp.track import Track

HEADER = (
    "t_s",
    "omega_1_rad_s",
    "omega_2_rad_s",
    "omega_3_rad_s",
    "q_w",
    "q_x",
    "q_y",
    "q_z",
    "axis_x",
    "axis_y",
    "axis_z",
    "momentum_x_Nms",
    "momentum_y_Nms",
    "momentum_z_Nms",
    "nutation_deg",
    "body_cone_deg",
    "space_cone_deg",
    "pulse",
)


def track_csv(track: Track, inertia: Inertia) -> str:
    """One row a sample; body rates and quaternion (body -> inertial, scalar first) in the axes of the file."""
    rates, quaternion = file_axes(track.rates, track.quaternion, inertia)
    cones = np.degrees(np.column_stack([track.nutation, track.body_cone, track.space_cone]))
    table = np.column_stack([track.t, rates, quaternion, track.axis, track.momentum, cones])
    rows = ([*map(number, row), str(pulse)] for row, pulse in zip(table.tolist(), track.pulse.tolist(), strict=True))
    return csv_text(HEADER, rows)

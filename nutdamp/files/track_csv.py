"""The track of a flight as a table: an array with named columns, and CSV."""

from __future__ import annotations

from collections.abc import Iterable
from typing import IO

import numpy as np
from numpy.typing import NDArray

from nutdamp.rounding import cleaned
from nutdamp.spacecraft import Inertia
from nutdamp.track import Track, in_file_axes

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


ROW = np.dtype([(name, np.int64 if name == "pulse" else np.float64) for name in HEADER])
"""One row of the track."""


def track_array(track: Track, inertia: Inertia) -> NDArray[np.void]:
    """One row a sample, fields as in `HEADER`; rates and quaternion (scalar first) in the axes of the file."""
    turned = in_file_axes(track, inertia)
    cones = np.degrees(np.column_stack([track.nutation, track.body_cone, track.space_cone]))
    vectors = map(cleaned, (turned.rates, turned.quaternion, track.axis, track.momentum))
    table = np.column_stack([track.t, *vectors, cones])
    rows = np.empty(len(track.t), dtype=ROW)
    for name, column in zip(HEADER[:-1], table.T, strict=True):
        rows[name] = column
    rows["pulse"] = track.pulse
    return rows


def write_track(pieces: Iterable[Track], inertia: Inertia, stream: IO[bytes]) -> None:
    """The rows of `track_array` of all ``pieces`` as CSV, written as they come."""
    stream.write(f"{','.join(HEADER)}\r\n".encode())
    for piece in pieces:
        if not len(piece.t):
            continue
        stream.write(_lines(track_array(piece, inertia).tolist()).encode())


def _lines(rows: list[tuple[float, ...]]) -> str:
    """Rows of finite numbers as CSV, each by its repr: the shortest text that reads back the same."""
    return repr(rows)[2:-2].replace("), (", "\r\n").replace(", ", ",") + "\r\n"

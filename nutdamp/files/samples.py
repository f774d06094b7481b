"""The samples of a dispersion study as CSV, streamed as they are flown."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from os import PathLike, fspath
from pathlib import Path
from typing import IO, Any

import numpy as np

from nutdamp.errors import CannotWrite
from nutdamp.files.tabular import STDOUT, csv_text, whole_file
from nutdamp.montecarlo.inputs import BLOCK, DispersedInput
from nutdamp.montecarlo.statistics import OUTPUTS, Array
from nutdamp.montecarlo.study import Study
from nutdamp.spacecraft.model import Spacecraft

SUFFIXES = {"kg m²": "kgm2", "rad/s": "rad_s", "m/s²": "m_s2", "rad": "deg", "": "factor"}
"""Endings of headings for units; those not in it are written as they are."""
OUTPUT_COLUMNS = ("nutation_deg", "momentum_shift_deg", "axis_error_deg", "spin_change_rad_s", "propellant_kg")
"""Columns of `OUTPUTS`, in their order."""

SHORTEST = 12
"""Bytes that a number takes at least, on average, with its comma."""


def cone_columns(spacecraft: Spacecraft) -> list[str]:
    """Headings of the least and the largest angle to the direction of each cone."""
    names = [keep.name.replace(" ", "_") for keep in spacecraft.keep]
    return [f"{name}_{angle}" for name in names for angle in ("least_deg", "largest_deg")]


def column(entry: DispersedInput) -> str:
    """Heading of an input: its name with the unit as suffix."""
    return f"{entry.name.replace(' ', '_')}_{SUFFIXES.get(entry.unit, entry.unit)}"


class SamplesWriter:
    """Writer of one row a case: its number (from 1), the true value of each input, the outputs; angles in degrees.

    With cones the least and the largest angle from the spin axis to the direction of each cone follow.
    """

    def __init__(self, stream: IO[bytes], study: Study) -> None:
        self._stream, self._source = stream, study.source()
        self._inputs = study.model.inputs.drawn
        self._outputs = [*OUTPUT_COLUMNS, *cone_columns(study.model.spacecraft)]
        header = ["case", *(column(entry) for entry in self._inputs), *self._outputs]
        stream.write(csv_text(header, []).encode())
        stream.flush()  # a full disk is better reported before the first case is flown

    def write(self, first: int, values: Array) -> None:
        """The cases from ``first`` (from 0) on, with their `Results.values` (5 + 2m, n)."""
        last = first + values.shape[1]
        for block in range(first // BLOCK, math.ceil(last / BLOCK)):
            low, high = max(first, block * BLOCK), min(last, (block + 1) * BLOCK)
            draws, _ = self._source.block(block)
            columns = [list(map(str, range(low + 1, high + 1)))]
            for entry in self._inputs:
                draw = np.broadcast_to(draws[entry.name], BLOCK)[low - block * BLOCK : high - block * BLOCK]
                columns.append(_texts(_shown(entry, draw)))
            outputs = values[:, low - first : high - first]
            for name, row in zip(self._outputs, outputs, strict=True):
                columns.append(_texts(np.degrees(row) if name.endswith("_deg") else row))
            lines = map(",".join, zip(*columns, strict=True))
            self._stream.write(("\r\n".join(lines) + "\r\n").encode())


def _shown(entry: DispersedInput, draw: Array) -> Array:
    truth = entry.nominal + draw
    return np.degrees(truth) if entry.unit == "rad" else truth


def _texts(values: Array) -> list[str]:
    """Numbers that read back as they were; NaN is empty."""
    if math.isnan(values[0]):
        return [""] * len(values)
    return list(map(repr, values.tolist()))


def check_room(path: str, study: Study, samples: int) -> None:
    """Raise CannotWrite at once where a disk cannot hold so many rows, rather than when it is full."""
    if path == STDOUT or (Path(path).exists() and not Path(path).is_file()):
        return
    needed = samples * SHORTEST * (len(study.model.inputs.drawn) + len(OUTPUTS) + 2 * len(study.model.spacecraft.keep))
    try:
        free = shutil.disk_usage(Path(path).resolve().parent).free
    except OSError:
        return  # the folder cannot be looked at: writing will say why
    if needed > free:
        raise CannotWrite(
            path, f"{samples} rows take more than {needed / 1e9:.3g} GB, and {free / 1e9:.3g} GB are free there"
        )


def streamed(
    path: PathLike[str] | str | None,
    cases: Any,
    writer: Callable[[IO[bytes], Any], Any],
    fly: Callable[[Callable[..., None] | None], None],
) -> CannotWrite | None:
    """Fly ``cases``, and write them with a ``writer`` to a file, if one is named; the error if they are not all saved.

    Raises CannotWrite where no case has flown yet, KeyboardInterrupt where the flight ended before the first.
    """

    def fly_some(collect: Callable[..., None] | None) -> None:
        fly(collect)
        if not cases.done:
            raise KeyboardInterrupt  # so that no file is written

    if path is None:
        fly_some(None)
        return None
    full: list[OSError] = []
    try:
        with whole_file(fspath(path)) as stream:
            rows = writer(stream, cases.study)

            def collect(*part: Any) -> None:
                try:
                    if not full:
                        rows.write(*part)
                except BrokenPipeError:
                    raise
                except OSError as reason:
                    full.append(reason)

            fly_some(collect)
            if full:
                raise full[0]
    except CannotWrite as wrong:
        if not cases.done:
            raise
        return wrong
    return None

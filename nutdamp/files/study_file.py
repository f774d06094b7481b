"""The file in which an interrupted dispersion study waits to be taken up again."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from nutdamp import __version__
from nutdamp.dispersion.outputs import OUTPUTS, ROWS
from nutdamp.dispersion.statistics import Sketch
from nutdamp.dispersion.study import EARLY, KEPT_WORST, Results, Study
from nutdamp.errors import BadRequest, CannotRead
from nutdamp.files.output import whole_file

ANOTHER = "it belongs to another study: spacecraft, schedule, dispersions, --seed, --impulses and version must agree"

MOST_BYTES = 1 << 30
"""Of a file of results: more than those of `EXACT_CASES` cases take."""

DAMAGED = "it is no file that --resume has written, or is damaged"


def save_results(path: str, results: Results) -> None:
    """Keep what is done of a study, whole or not at all. Raises CannotWrite."""
    study, done = results.study, results.done
    arrays: dict[str, Any] = {
        "made_by": np.array(_made_by()),
        "fingerprint": np.array(study.fingerprint),
        "counts": np.array([done, results.redrawn, results.met, results.emptied], dtype=np.int64),
        "worst_cases": results.worst.cases,
        "worst_severities": results.worst.severities,
        "early": results.early[:, : min(done, EARLY)],
        "broken": results.broken,
        "aspects": results.aspects,
    }
    if results.sketches is None:
        assert results.values is not None
        arrays["values"] = results.values[:, :done]
    else:
        arrays["sketches"] = np.array([sketch.counts for sketch in results.sketches])
        arrays["extremes"] = np.array([[sketch.minimum, sketch.maximum] for sketch in results.sketches])
    with whole_file(path) as stream:
        np.savez(stream, **arrays)


def load_results(path: str, study: Study, requested: int) -> Results:
    """What is done of ``study``, with room for ``requested`` cases; nothing where there is no such file yet.

    Raises CannotRead, and BadRequest where the file is of another study or holds more cases.
    """
    if not Path(path).exists():
        return Results(study, requested)
    try:
        with Path(path).open("rb") as stream:
            _expect_unpacked(stream)
            stream.seek(0)
            with np.load(stream, allow_pickle=False) as kept:
                arrays = {name: kept[name] for name in kept.files}
        belongs = str(arrays["fingerprint"]) == study.fingerprint and str(arrays["made_by"]) == _made_by()
        if belongs:
            _check(arrays, len(study.model.spacecraft.keep))
    except Exception as reason:  # a damaged archive makes zipfile, zlib and numpy fail in many ways
        if isinstance(reason, OSError) and reason.filename is not None:  # it was not even opened
            raise CannotRead(path, str(reason.strerror)) from reason
        raise CannotRead(path, DAMAGED) from reason
    if not belongs:
        raise BadRequest(f"cannot resume from {path}: {ANOTHER}")
    try:
        return _results(study, arrays).extended(requested)
    except BadRequest as wrong:
        raise BadRequest(f"cannot resume from {path}: {wrong}") from wrong


def _expect_unpacked(stream: IO[bytes]) -> None:
    """Raises ValueError for an archive that unfolds to more than it takes itself, as `save_results` writes none."""
    size = os.fstat(stream.fileno()).st_size
    with zipfile.ZipFile(stream) as archive:
        unfolded = sum(entry.file_size for entry in archive.infolist())
    if size > MOST_BYTES or unfolded > size:
        raise ValueError(f"{unfolded} bytes in a file of {size}")


def _made_by() -> str:
    return f"nutdamp {__version__}"


def _check(arrays: dict[str, Any], cones: int) -> None:
    """Raises ValueError or KeyError for arrays of a study with so many ``cones`` that `save_results` does not write."""
    done, redrawn, met, emptied = arrays["counts"].tolist()
    worst, early, outputs = min(done, KEPT_WORST), min(done, EARLY), len(OUTPUTS)
    forms: dict[str, tuple[type, tuple[int, ...]]] = {
        "counts": (np.int64, (4,)),
        "worst_cases": (np.int64, (worst,)),
        "worst_severities": (np.float64, (worst,)),
        "early": (np.float64, (ROWS, early)),
        "broken": (np.int64, (cones,)),
        "aspects": (np.float64, (cones, 2)),
    }
    if "values" in arrays:
        forms["values"] = (np.float64, (outputs + 2 * cones, done))
    else:
        forms |= {"sketches": (np.int64, (outputs, len(Sketch().counts))), "extremes": (np.float64, (outputs, 2))}
    for name, (kind, shape) in forms.items():
        if arrays[name].dtype != kind or arrays[name].shape != shape:
            raise ValueError(f"{name} is {arrays[name].dtype} {arrays[name].shape}, expected {kind} {shape}")
    cases, counted = arrays["worst_cases"], arrays.get("sketches", np.full((1, 1), done))
    possible = done > 0 and redrawn >= 0 and 0 <= met <= done - emptied <= done
    possible = possible and np.all((cases >= 0) & (cases < done))
    possible = possible and np.all((arrays["broken"] >= 0) & (arrays["broken"] <= done))
    if not (possible and np.all(counted >= 0) and np.all(counted.sum(axis=1) == done)):
        raise ValueError("counts that no study has")


def _results(study: Study, arrays: dict[str, Any]) -> Results:
    done, redrawn, met, emptied = (int(count) for count in arrays["counts"])
    sketches = None
    if "sketches" in arrays:
        sketches = [Sketch() for _ in OUTPUTS]
        for sketch, counts, (least, most) in zip(sketches, arrays["sketches"], arrays["extremes"], strict=True):
            sketch.counts, sketch.minimum, sketch.maximum = counts, float(least), float(most)
    results = Results(study, done, done, redrawn, met, emptied, values=arrays.get("values"), sketches=sketches)
    results.worst.cases, results.worst.severities = arrays["worst_cases"], arrays["worst_severities"]
    results.broken, results.aspects = arrays["broken"], arrays["aspects"]
    results.early[:, : arrays["early"].shape[1]] = arrays["early"]
    return results

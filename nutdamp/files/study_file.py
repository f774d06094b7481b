"""The file in which an interrupted dispersion study waits to be taken up again."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from nutdamp import __version__
from nutdamp.dispersion.outputs import OUTPUTS
from nutdamp.dispersion.statistics import Sketch
from nutdamp.dispersion.study import EARLY, Results, Study
from nutdamp.errors import BadRequest, CannotRead
from nutdamp.files.output import whole_file

ANOTHER = "it belongs to another study: spacecraft, schedule, dispersions, --seed, --flown and nutdamp must be the same"


def save_results(path: str, results: Results) -> None:
    """Keep what is done of a study, whole or not at all. Raises CannotWrite."""
    study, done = results.study, results.done
    arrays: dict[str, Any] = {
        "made_by": np.array(f"nutdamp {__version__}"),
        "fingerprint": np.array(study.fingerprint),
        "counts": np.array([done, results.redrawn, results.met], dtype=np.int64),
        "worst_cases": results.worst.cases,
        "worst_severities": results.worst.severities,
        "early": results.early[:, : min(done, EARLY)],
    }
    if results.sketches is None:
        assert results.values is not None
        arrays["values"] = results.values[:, :done]
    else:
        arrays["sketches"] = np.array([sketch.counts for sketch in results.sketches])
        arrays["extremes"] = np.array([[sketch.minimum, sketch.maximum] for sketch in results.sketches])
    with whole_file(path) as stream:
        np.savez(stream, **arrays)


def load_results(path: str, study: Study, asked: int) -> Results:
    """What is done of ``study``, with room for ``asked`` cases; nothing where there is no such file yet.

    Raises CannotRead, and BadRequest where the file is of another study or holds more cases.
    """
    if not Path(path).exists():
        return Results(study, asked)
    try:
        with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as kept:
            arrays = {name: kept[name] for name in kept.files}
        if str(arrays["fingerprint"]) != study.fingerprint or str(arrays["made_by"]) != f"nutdamp {__version__}":
            raise BadRequest(f"cannot resume from {path}: {ANOTHER}")
        results = _results(study, arrays)
    except OSError as reason:
        raise CannotRead(path, reason.strerror or str(reason)) from reason
    except (KeyError, ValueError, EOFError, zipfile.BadZipFile) as reason:
        raise CannotRead(path, "it is no file that --resume has written") from reason
    try:
        return results.extended(asked)
    except BadRequest as wrong:
        raise BadRequest(f"cannot resume from {path}: {wrong}") from wrong


def _results(study: Study, arrays: dict[str, Any]) -> Results:
    done, redrawn, met = (int(count) for count in arrays["counts"])
    sketches = None
    if "sketches" in arrays:
        sketches = [Sketch() for _ in OUTPUTS]
        for sketch, counts, (least, most) in zip(sketches, arrays["sketches"], arrays["extremes"], strict=True):
            sketch.counts, sketch.minimum, sketch.maximum = counts, float(least), float(most)
    results = Results(study, done, done, redrawn, met, values=arrays.get("values"), sketches=sketches)
    results.worst.cases, results.worst.severities = arrays["worst_cases"], arrays["worst_severities"]
    results.early[:, : arrays["early"].shape[1]] = arrays["early"]
    return results

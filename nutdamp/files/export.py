"""Exchange formats (attitude file of the Systems Tool Kit, script for Basilisk, epochs and frames),
and samples as CSV.

The samples of a dispersion study are streamed as they are flown.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from nutdamp import __version__
from nutdamp.common.numerics import cleaned
from nutdamp.common.results import Table
from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest, CannotWrite, Unsuitable
from nutdamp.files.tabular import csv_text, number_rows, structured, whole_file
from nutdamp.flight.basilisk import default_step, stretches
from nutdamp.flight.dynamics import shed
from nutdamp.flight.propagation import Flight
from nutdamp.montecarlo.inputs import BLOCK, DispersedInput
from nutdamp.montecarlo.statistics import EXACT_CASES, Array
from nutdamp.montecarlo.study import Results, Study
from nutdamp.physics.frames import PRECESSED
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Spacecraft, Vector

if TYPE_CHECKING:
    from nutdamp.planning.screening import Dispersion

SCRIPT = Path(__file__).parents[1] / "data" / "basilisk.txt"  # of `str.format`
LONGEST_STEP = 0.1  # rad; the body turns by no more in one step of the script


def basilisk_script(plan: Plan) -> str:
    """The text of the script; raises BadRequest for dissipation, a wheel, or moments that fall."""
    spacecraft = plan.spacecraft
    wheel = spacecraft.inertia.wheel
    unfit = {
        "a rigid body: leave dissipation out of the spacecraft file": spacecraft.dissipation,
        "one rigid body: it has no wheel, and the spacecraft file has one": wheel,
        "constant moments of inertia: leave tank.inertia_per_kg out of the spacecraft file, and "
        "plan without it, if the moments may count as constant": shed(spacecraft) is not None,
    }
    for words, holds in unfit.items():
        if holds:
            raise BadRequest(f"a Basilisk script flies {words}")
    rates, quaternion = spacecraft.inertia.in_file_axes(
        spacecraft.initial.rates, spacecraft.initial.quaternion
    )
    title = (
        " ".join(
            f"{plan.scheme} schedule for {spacecraft.name}, "
            f"status {plan.verdict.status.value}".split()
        )
        .replace("\\", "/")
        .replace('"', "'")
    )
    return SCRIPT.read_text(encoding="utf-8").format(
        title=title,
        version=__version__,
        tensor=f"[{', '.join(map(_vector, spacecraft.inertia.tensor))}]",
        moments=_vector(spacecraft.inertia.moments),
        axes=f"[{', '.join(map(_vector, spacecraft.inertia.axes))}]",
        rates=_vector(rates),
        quaternion=_vector(quaternion),
        turn=LONGEST_STEP,
        steps="\n".join(f"    {step}," for step in _steps(plan, spacecraft)),
    )


def _steps(plan: Plan, spacecraft: Spacecraft) -> Iterable[str]:
    """Rows of the schedule: channel, duration, torque; an ideal impulse lasts no time and gives its
    impulse.
    """
    pulses, axes = plan.pulses, spacecraft.inertia.axes
    last = max([pulses.end, *spacecraft.edges])
    longest = default_step(spacecraft, pulses, last)
    firing_edges = (edge for pulse in pulses for edge in pulse.edges)
    edges = sorted({0.0, last, *spacecraft.edges, *firing_edges})
    for now, end in zip(edges, [*edges[1:], last], strict=True):
        for pulse in pulses:
            if pulse.torque is None and pulse.t == now:
                yield f"({pulse.channel!r}, 0.0, {_vector(axes @ pulse.impulse)})"
        firing = [pulse.channel for pulse in pulses if pulse.push(now, end) is not None]
        if end > now:
            for duration, torque in stretches(spacecraft, pulses, now, end, longest):
                yield (
                    f"({' + '.join(firing) or 'coast'!r}, {float(duration)!r}, "
                    f"{_vector(axes @ torque)})"
                )


def _vector(vector: Iterable[float] | Vector) -> str:
    return "[" + ", ".join(repr(float(part) + 0.0) for part in vector) + "]"


AXES = {"EME2000": "J2000", "J2000": "J2000", "GCRF": "ICRF"}
"""Inertial frames that the formats have a name for, and their names in that of the Systems Tool
Kit.
"""
FRAME_NAMES = {**{frame: frame for frame in AXES}, "ICRF": "GCRF"}
"""Frames of a spacecraft file by their names in messages."""

MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")

EXAMPLE = {
    "epoch": "2026-03-01T12:00:00Z           # of t = 0, UTC",
    "frame": "EME2000                        # or J2000, GCRF",
    "quaternion": "[1, 0, 0, 0]              # body -> frame at t = 0, scalar first",
}

TURN = math.radians(6.0)
"""rad; the body turns by no more between two records. Interpolation with the rates then errs by
less than 1e-5 deg, and even a plain turn from one attitude to the next by less than 0.01 deg at 5
deg of nutation.
"""

LEAST_RECORDS = 4  # records of a stretch, however short: enough for interpolation of degree 3
MOST_RECORDS = 1_000_000  # more make no file that anyone reads
NANOSECONDS = (
    1e9  # nanoseconds in a second; to divide by them gives the number nearest to the decimal one
)


class Reference(NamedTuple):
    """The moment t = 0 and the frame of the attitude."""

    epoch: Epoch
    frame: str


class AttitudeSegment(NamedTuple):
    """Motion without jumps, in the axes of the file, ``completed`` pulses of which are over when it
    begins.

    ``t`` (n,) s, whole nanoseconds; ``rates`` (n, 3) rad/s; ``quaternion`` (n, 4) body -> frame,
    scalar first.
    """

    t: Vector
    rates: Vector
    quaternion: Vector
    completed: int


def reference(spacecraft: Spacecraft) -> Reference:
    """Epoch of the file, and its frame, or EME2000 for those of the ecliptic and of date; raises
    BadRequest with the lines to add, or for a frame that no format knows.
    """
    start = spacecraft.attitude
    if start is None or start.epoch is None or start.frame is None:
        missing = [key for key in EXAMPLE if start is None or getattr(start, key) is None]
        names = " and ".join(f"attitude.{key}" for key in missing if key != "quaternion")
        lines = "\n".join(f"  {key}: {EXAMPLE[key]}" for key in missing)
        place = "add" if start is None else "add there"
        raise BadRequest(
            f"this format needs {names}, which the spacecraft file does not give; "
            f"{place}\nattitude:\n{lines}"
        )
    frame = "EME2000" if start.frame in PRECESSED else start.frame
    if frame not in AXES:
        raise Unsuitable(
            ("attitude", "frame"),
            f"{frame!r} is no frame that the format knows; expected one of {', '.join(AXES)}",
        )
    return Reference(Epoch.parse(start.epoch), frame)


def interpolated(flown: Flight, until: float) -> Iterator[AttitudeSegment]:
    """The motion from 0 to ``until`` s between the edges of pulses, close enough to be
    interpolated.

    Stretches too short for nanoseconds are left out. Raises BadRequest for more records than
    `MOST_RECORDS`.
    """
    legs = [leg for leg in flown.legs if leg.start < until]
    counts = []
    for leg in legs:  # so many that the turn from one record to the next stays below `TURN`
        end = min(leg.end, until)
        rates, _ = leg.path.motion(np.linspace(leg.start, end, 9))
        turn = float(np.linalg.norm(rates, axis=1).max()) * (end - leg.start)
        counts.append(max(math.ceil(turn / TURN) + 1, LEAST_RECORDS))
    if (total := sum(counts)) > MOST_RECORDS:
        raise BadRequest(
            f"the track would have {total} records, more than {MOST_RECORDS}; choose an earlier "
            "end (until)"
        )
    previous: Vector | None = None  # the quaternion of the record before
    for leg, count in zip(legs, counts, strict=True):
        begin, end = (round(time * NANOSECONDS) for time in (leg.start, min(leg.end, until)))
        t = np.unique(np.rint(np.linspace(begin, end, count))) / NANOSECONDS
        if len(t) < LEAST_RECORDS:
            continue
        rates, quaternion = map(cleaned, flown.spacecraft.inertia.in_file_axes(*leg.path.motion(t)))
        # Of q and -q always the one nearer to the record before.
        before = np.vstack([quaternion[0] if previous is None else previous, quaternion[:-1]])
        steps = np.sum(quaternion * before, axis=1)
        quaternion = np.asarray(quaternion * np.cumprod(np.where(steps < 0.0, -1.0, 1.0))[:, None])
        previous = quaternion[-1]
        yield AttitudeSegment(t, rates, quaternion, leg.completed)


def stk_attitude(flown: Flight, until: float, reference: Reference, about: str = "") -> str:
    """The text of the file from 0 to ``until`` s, with a comment ``about`` it.

    Where rates jump, the second row comes a nanosecond later.
    """
    rows: list[str] = []
    last: tuple[float, list[float]] | None = None
    for stretch in interpolated(flown, until):
        rates = np.degrees(stretch.rates).tolist()
        for t, (scalar, *vector), rate in zip(
            stretch.t.tolist(), stretch.quaternion.tolist(), rates, strict=True
        ):
            if last is not None and t <= last[0]:
                if np.allclose(rate, last[1], rtol=0.0, atol=1e-9 * np.linalg.norm(rate)):
                    continue
                t = last[0] + 1.0 / NANOSECONDS
            rows.append(
                " ".join([f"{t:.9f}", *(f"{part:.16e}" for part in (*vector, scalar, *rate))])
            )
            last = t, rate
    date, _, clock = reference.epoch.text.partition("T")
    day = datetime.date.fromisoformat(date)
    lines = [
        "stk.v.11.0",
        f"# nutdamp {__version__}: {' '.join(f'{flown.spacecraft.name} {about}'.split())}",
        "BEGIN Attitude",
        f"NumberOfAttitudePoints {len(rows)}",
        f"ScenarioEpoch {day.day} {MONTHS[day.month - 1]} {day.year} {clock}",
        "CentralBody Earth",
        f"CoordinateAxes {AXES[reference.frame]}",
        "InterpolationOrder 1",
        "AttitudeTimeQuatAngVels",
        *rows,
        "END Attitude",
    ]
    return "\n".join(lines) + "\n"


SUFFIXES = {"kg m²": "kgm2", "rad/s": "rad_s", "m/s²": "m_s2", "rad": "deg", "": "factor"}
"""Endings of headings for units; those not in it are written as they are."""
OUTPUT_COLUMNS = (
    "nutation_deg",
    "momentum_shift_deg",
    "axis_error_deg",
    "spin_change_rad_s",
    "propellant_kg",
)
"""Columns of `OUTPUTS`, in their order."""


def cone_columns(spacecraft: Spacecraft) -> list[str]:
    """Headings of the least and the largest angle to the direction of each cone."""
    names = [keep.name.replace(" ", "_") for keep in spacecraft.keep]
    return [f"{name}_{angle}" for name in names for angle in ("least_deg", "largest_deg")]


def column(entry: DispersedInput) -> str:
    """Heading of an input: its name with the unit as suffix."""
    return f"{entry.name.replace(' ', '_')}_{SUFFIXES.get(entry.unit, entry.unit)}"


def sample_header(study: Study) -> list[str]:
    """Columns of cases: number, true inputs, outputs, angles to cones, spin error."""
    return ["case", *map(column, study.model.inputs.drawn), *output_header(study)]


def output_header(study: Study) -> list[str]:
    """Columns of `Results.values`."""
    spacecraft = study.model.spacecraft
    spin = [] if spacecraft.goal.spin is None else ["spin_error_rad_s"]
    return [*OUTPUT_COLUMNS, *cone_columns(spacecraft), *spin]


def sample_columns(study: Study, first: int, values: Array) -> list[NDArray[Any]]:
    """Values of `sample_header` of the cases from ``first`` (from 0) on, with their
    `Results.values`; they count from 1, angles are in degrees.
    """
    cases = np.arange(first, first + values.shape[1])
    draws = study.draws_of_all(cases)
    columns: list[NDArray[Any]] = [cases + 1]
    for entry in study.model.inputs.drawn:
        truth = np.broadcast_to(entry.nominal + draws[entry.name], len(cases))
        columns.append(np.degrees(truth) if entry.unit == "rad" else truth)
    return [*columns, *in_degrees(output_header(study), values)]


def in_degrees(names: Sequence[str], rows: Iterable[Array]) -> list[Array]:
    """Rows, in SI, in the units of the columns ``names``."""
    return [
        np.degrees(row) if name.endswith("_deg") else row
        for name, row in zip(names, rows, strict=True)
    ]


def samples_array(flown: Dispersion) -> Table:
    """One row a case; raises BadRequest where the cases were counted and not kept."""
    return structured(
        sample_header(flown.core.study), sample_columns(flown.core.study, 0, _values(flown.core))
    )


def samples_file(flown: Dispersion) -> Callable[[IO[bytes]], None]:
    """Writer of the rows of `samples_array`; raises as that does."""
    values = _values(flown.core)
    return lambda stream: SamplesWriter(stream, flown.core.study).write(0, values)


def _values(core: Results) -> Array:
    if core.values is None:
        raise BadRequest(
            f"more than {EXACT_CASES:,} cases are counted and not kept: name a file for them, "
            "nutdamp.disperse(plan, csv=…)"
        )
    return core.values[:, : core.done]


def percentiles_array(flown: Dispersion, levels: Sequence[float]) -> Table:
    """One row a level, %, of each output, NaN where it is not known."""
    names = output_header(flown.core.study)
    shares = np.array(levels) / 100.0
    unknown = np.full(len(shares), math.nan)
    spreads = map(flown.core.spread_of, range(len(names)))
    rows = [unknown if spread is None else spread.quantiles(shares) for spread in spreads]
    return structured(["percent", *names], [np.array(levels), *in_degrees(names, rows)])


class SamplesWriter:
    """Writer of one row a case, see `sample_columns`."""

    def __init__(self, stream: IO[bytes], study: Study) -> None:
        self._stream, self._study = stream, study
        stream.write(csv_text(sample_header(study), []).encode())
        stream.flush()  # a full disk is better reported before the first case is flown

    def write(self, first: int, values: Array) -> None:
        """The cases from ``first`` (from 0) on, with their `Results.values`."""
        for begin in range(0, values.shape[1], BLOCK):  # texts of all would take much memory
            part = values[:, begin : begin + BLOCK]
            columns = sample_columns(self._study, first + begin, part)
            self._stream.write(number_rows(columns))


class FlownCases(Protocol):
    """Results of cases, of which ``done`` have flown."""

    done: int


Flown = TypeVar("Flown", bound=FlownCases)


def streamed(
    path: PathLike[str] | str | None,
    study: Any,
    writer: Callable[[IO[bytes], Any], Any],
    fly: Callable[[Callable[..., None] | None], Flown],
) -> tuple[Flown, CannotWrite | None]:
    """Fly cases of a ``study``, and write them with a ``writer`` to a file, if one is named.

    Returns what ``fly`` does, and the error if they are not all saved. Raises CannotWrite where no
    case has flown yet, KeyboardInterrupt where the flight ended before the first.
    """

    def flown(collect: Callable[..., None] | None) -> Flown:
        results = fly(collect)
        if not results.done:
            raise KeyboardInterrupt  # so that no file is written
        return results

    if path is None:
        return flown(None), None
    results: Flown | None = None
    full: list[OSError] = []

    def collect(*part: Any) -> None:
        try:
            if not full:
                rows.write(*part)
        except BrokenPipeError:
            raise
        except OSError as reason:
            full.append(reason)

    try:
        with whole_file(fspath(path)) as stream:
            rows = writer(stream, study)
            results = flown(collect)
            if full:
                raise full[0]
    except CannotWrite as wrong:
        if results is None:
            raise
        return results, wrong
    return results, None

"""The fit to telemetry: estimates and their accuracy, signals and their residuals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from operator import attrgetter, itemgetter
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from nutdamp.common.results import Note, note
from nutdamp.estimation.model import MOVED, Fit
from nutdamp.estimation.parameters import KIND, in_moments, untold
from nutdamp.estimation.results import (
    CORRELATED,
    UNTOLD,
    Carried,
    Estimate,
    Fitted,
    Pointing,
    carried,
    correlated,
    doubts,
    estimates,
    pointings,
)
from nutdamp.files.carried import notes
from nutdamp.units import screen_unit
from nutdamp.views.decisions import heading, opening
from nutdamp.views.parts import Summary, direction_columns
from nutdamp.views.tables import TEXT, WHOLE, Column, DataTable, to_figures, values_of
from nutdamp.views.text import fixed, note_json

NOTHING = 1e-3  # sigmas below which a value, or a change, is zero
MOST_PAIRS = 6  # largest number of correlations named


def in_shown(signal: str) -> tuple[str, float]:
    """Unit in which a signal is shown, and its factor from SI."""
    unit = KIND[signal].unit
    if unit == "s":
        return "ms", 1e3
    return (
        (unit.replace("rad", "deg"), 180.0 / math.pi)
        if unit.startswith("rad")
        else screen_unit(unit)
    )


def _unit(row: Estimate) -> tuple[str, float]:
    """Unit of an estimate on screens, and its factor from SI."""
    return screen_unit(row.unit, row.factor)


def _scaled(name: str, row: Estimate) -> float | None:
    value = getattr(row, name)
    return None if value is None or math.isinf(value) else value * _unit(row)[1]


def _value(row: Estimate) -> str:
    """The value to the digits that its sigma leaves, 0 where it is within rounding of it."""
    shown = row.value if math.isinf(row.sigma) or abs(row.value) > NOTHING * row.sigma else 0.0
    return f"{shown * _unit(row)[1]:.{_digits(row)}g}"


def _file(row: Estimate) -> str | None:
    digits = max(_digits(row) - 2, 4)
    return None if row.file is None else f"{row.file * _unit(row)[1]:.{digits}g}"


def _changed(change: float) -> str:
    if abs(change) <= NOTHING:
        return "0"
    return f"{change:+.2g}" if abs(change) < 99.5 else f"{change:+.0f}"


def _digits(estimate: Estimate) -> int:
    """Significant digits of a value that its sigma leaves, and one more."""
    if estimate.value == 0.0 or estimate.sigma <= 0.0 or math.isinf(estimate.sigma):
        return 4
    return min(max(2 + math.ceil(math.log10(max(abs(estimate.value) / estimate.sigma, 1.0))), 2), 9)


ESTIMATES = (
    Column.named(
        "quantity=key", "quantity", "", where="screen json", kind=TEXT, words=attrgetter("label")
    ),
    Column(
        "value",
        "value",
        "",
        lambda row: row.value * row.factor,
        where="screen json",
        words=_value,
    ),
    Column(
        "sigma",
        "sigma",
        "",
        lambda row: row.sigma * row.factor,
        where="screen json",
        words=lambda row: None if math.isinf(row.sigma) else f"{_scaled('sigma', row):.2g}",
    ),
    Column("unit", "unit", "", lambda row: _unit(row)[0], where="screen json", kind=TEXT),
    Column("file", "file", "", partial(_scaled, "file"), where="screen json", words=_file, rank=1),
    Column("file_sigma", "", "", lambda row: _scaled("prior", row), where="json"),
    Column.named("change_sigmas=change", "change", "sigmas", _changed, "screen json"),
    Column.named("from=source", "from", "", where="screen json", kind=TEXT, rank=2),
)


def pointing_table(fit: Fit, time: float) -> DataTable:
    """Directions of spin axis and H at ``time`` s; no rows where the record shows none."""
    angles = [
        column._replace(value=partial(_of_direction, column), where="screen json")
        for column in direction_columns(fit.model.spacecraft)
    ]
    digits = to_figures(2)
    sigmas = (
        Column.named("sigma_along_deg=along", "sigma along", "deg", digits, "screen json"),
        Column.named("sigma_across_deg=across", "sigma across", "deg", digits, "screen json"),
        Column.named(
            "correlation", "correlation", "", partial(fixed, digits=2), "screen json", rank=2
        ),
        Column.named("from=source", "from", "", where="screen json", kind=TEXT, rank=1),
    )
    name = Column.named("direction=name", "direction", "", where="screen json", kind=TEXT)
    return DataTable("Pointing", (name, *angles, *sigmas), pointings(fit, time))


def _of_direction(column: Column, row: Pointing) -> Any:
    return column.value(row.direction)


def signal_table(fit: Fit) -> DataTable:
    """The signals of the record, counted from 0, with the test of their residuals."""
    of_signal = [fit.model.signal == at for at in range(len(fit.model.signals))]

    def verdict(at: int) -> str:
        if not fit.resolved[at]:
            return "limited by resolution"
        return "white" if fit.white(at) else "NOT white, sigmas too small"

    columns = (
        Column(
            "signal", "signal", "", lambda at: fit.model.signals[at], where="screen json", kind=TEXT
        ),
        Column(
            "samples",
            "samples",
            "",
            lambda at: int(of_signal[at].sum()),
            where="screen json",
            kind=WHOLE,
        ),
        Column(
            "outliers",
            "outliers",
            "",
            lambda at: int((of_signal[at] & ~fit.used).sum()),
            where="screen json",
            kind=WHOLE,
        ),
        Column(
            "noise_SI",
            "noise",
            "",
            lambda at: float(fit.noise[at]),
            where="screen json",
            words=lambda at: f"{fit.noise[at] * in_shown(fit.model.signals[at])[1]:.3g}",
        ),
        Column(
            "", "unit", "", lambda at: in_shown(fit.model.signals[at])[0], where="screen", kind=TEXT
        ),
        Column("white", "residuals", "", fit.white, where="screen json", kind=TEXT, words=verdict),
    )
    return DataTable("Signals", columns, range(len(of_signal)))


def fit_screen(fit: Fit, time: float, *, verbose: bool = True) -> RenderableType:
    """The screen of ``fit``; the motion is that at ``time`` s."""
    rows = estimates(fit, time)
    names = fit.model.signals
    colored = [name for at, name in enumerate(names) if fit.resolved[at] and not fit.white(at)]
    test = (
        f"residuals NOT white: {', '.join(colored)}; the sigmas are too small"
        if colored
        else "residuals: noise"
    )
    outliers = int((~fit.used).sum())
    if outliers:
        test += f"; outliers left out: {outliers}"
    record, values, spacecraft = fit.model.record, fit.named, fit.model.spacecraft
    A, C = in_moments(spacecraft, values)
    wheel = values.get("wheel", spacecraft.inertia.wheel) / A
    # Of the nutation in the body, small angles.
    rate = abs((1.0 - C / A) * values.get("omega_3", spacecraft.spin) - wheel)
    turns = f", nutation periods: {record.length * rate / (2.0 * math.pi):.3g}" if rate else ""
    fired = f", pulses fired meanwhile: {len(record.fired)}" if len(record.schedule) else ""
    what = f", {record.start:g} s to {record.end:g} s{turns}{fired}"
    headline = Text.assemble("FIT ", (", ".join(names), "bold"), what)
    head = [*opening(spacecraft, verbose), headline, Text(test, "bold red" if colored else "green")]
    if not verbose:
        # Where not all fit, what moved from the file stands before what did not.
        stays = [row.change is not None and abs(row.change) <= MOVED for row in rows]
        rows = tuple(row for _, row in sorted(zip(stays, rows, strict=True), key=itemgetter(0)))
    table = DataTable("Estimates", ESTIMATES, rows)
    head.append(Text(f"motion at t = {time:g} s"))
    directions = pointing_table(fit, time)
    if directions.rows:
        head.append(directions.screen("screen"))
    signals = [signal_table(fit).screen("screen")] if verbose else []
    return Summary(
        head,
        lambda first=None: [table.screen("screen", first=first and max(first, 3)), *signals],
        [*told(fit, rows)],
        "-o now.yaml · --plot fit.png",
        verbose,
    )


def told(fit: Fit, rows: Sequence[Estimate]) -> Iterator[Note]:
    """Parameters that the data do not determine, or only together, and unexpected estimates."""
    yield from doubts(fit)
    yield from _untold(fit)
    of_file = [estimate.label for estimate in rows if estimate.source == UNTOLD]
    if of_file:
        yield note("fit-kept", estimates=", ".join(of_file))
    both = 0.0 if fit.steady else float(carried(fit, fit.model.start).correlation[0, 1])
    tied = [f"A and C {both:+.4f}"] if abs(both) > CORRELATED else []
    tied += [
        f"{first} and {second} {value:+.3f}"
        for first, second, value in correlated(fit)[:MOST_PAIRS]
    ]
    if tied:
        yield note("correlated-inputs", inputs=", ".join(tied))
    if fit.model.unequal and fit.model.spacecraft.inertia.symmetric:
        yield note("fit-one-moment")


def _untold(fit: Fit) -> Iterator[Note]:
    yield from untold(fit.model.record)
    if not pointings(fit, fit.model.start):
        yield note("fit-axis-of-file", signals=", ".join(fit.model.signals))


def fit_json(fitted: Fitted, at_time: Carried) -> dict[str, Any]:
    """Estimates with sigmas, values of the file, signals, covariance of the inputs of dispersions.

    Warnings of reading the record stand in the notes, before the doubts about the estimates.
    """
    fit, model = fitted.core, fitted.core.model
    return {
        **heading(model.spacecraft),
        "record": {
            **values_of(model.record, "start_s", "end_s"),
            "pulses": len(model.record.fired),
            "signals": signal_table(fit).json(),
        },
        "time_s": at_time.time,
        "pointing": pointing_table(fit, at_time.time).json(),
        "estimates": DataTable("Estimates", ESTIMATES, estimates(fit, at_time.time)).json(),
        "kept": list(fit.kept),
        "parameters": [parameter.name for parameter in model.parameters],
        **values_of(fit, "values_SI=values", "covariance_SI=region"),
        "dispersed": {
            "inputs": list(at_time.names),
            **values_of(at_time, "values_SI=values", "sigmas_SI=sigmas", "correlation"),
        },
        "notes": [
            note_json(entry)
            for entry in (
                *(note("record-read", warning=warning) for warning in fitted.warnings),
                *(*doubts(fit), *_untold(fit), *notes(fit, at_time)),
            )
        ],
    }

"""The screen of ``simulate``: cone angles around each pulse, residuals, extremes of the axis track."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.flight import Flight, Residual
from nutdamp.report.end_tables import end_table
from nutdamp.report.layout import columns, facts
from nutdamp.report.plan_tables import channel_text, header
from nutdamp.report.text import degrees, longitude, moment, pointing
from nutdamp.track import Extremes


def simulation_screen(
    flight: Flight, found: Extremes, residual: Residual, flown: Residual, *, how: str
) -> RenderableType:
    """Everything that ``simulate`` shows; ``how`` names what was propagated."""
    parts: list[RenderableType] = [header(flight.spacecraft), Text(), Text(how, style="bold")]
    if len(flight.schedule):
        parts += [Text(), _pulses(flight)]
    parts += [Text(), _residuals(residual, flown), Text(), end_table(flight)]
    parts += [Text(), _extremes(found, flight)]
    return Group(*parts)


def _pulses(flight: Flight) -> Table:
    before, after = flight.around_pulses()
    names = ("pulse", "centre", "on-time", "channel", "", "nutation", "body cone", "space cone")
    units = ("", "s", "s", "", "", "deg", "deg", "deg")
    table = columns(*(f"{name}\n{unit}" for name, unit in zip(names, units, strict=True)), text=("channel\n", "\n"))
    for index, pulse in enumerate(flight.schedule):
        on_time = "ideal" if pulse.on_time == 0.0 else f"{pulse.on_time:.4f}"
        what = (str(index + 1), f"{pulse.t:.4f}", on_time, channel_text(pulse, flight.spacecraft))
        for cells, when, state in ((what, "before", before), (("",) * 4, "after", after)):
            cones = (float(cone[index]) for cone in (state.nutation, state.body_cone, state.space_cone))
            table.add_row(*cells, when, *(degrees(cone).removesuffix(" deg") for cone in cones))
    return table


def _residuals(residual: Residual, flown: Residual) -> Table:
    table = columns("after the last pulse", "by impulses (17)", "flown, real widths")
    rows = [
        ("nutation", "nutation"),
        ("body cone", "body_cone"),
        ("space cone", "space_cone"),
        ("shift of H", "momentum_shift"),
    ]
    if residual.axis_error != residual.momentum_shift:
        rows.append(("off the target", "axis_error"))
    for name, key in rows:
        table.add_row(Text(name, style="dim"), degrees(getattr(residual, key)), degrees(getattr(flown, key)))
    return table


def _extremes(found: Extremes, flight: Flight) -> Table:
    table = facts()
    far, near = found.farthest, found.nearest
    table.add_row(
        "spin axis from H(0)", f"{degrees(near[0])} at {moment(near[1])} to {degrees(far[0])} at {moment(far[1])}"
    )
    table.add_row("spin axis in x, in y", f"{_range(found.x)}, {_range(found.y)} of the inertial frame")
    given = flight.spacecraft.attitude
    if given is not None:
        frame = given.frame or "the frame of the file"
        west, east = map(longitude, found.right_ascension)
        table.add_row("right ascension", f"{west.removesuffix(' deg')} to {east} in {frame}, eastward")
        table.add_row("declination", _range(found.declination))
    table.add_row("track", f"{found.rows} rows, 0 to {moment(found.until)}")
    return table


def _range(values: tuple[float, float]) -> str:
    low, high = map(pointing, values)
    return f"{low.removesuffix(' deg')} to {high}"

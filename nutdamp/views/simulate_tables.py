"""The screen of ``simulate``: cone angles around each pulse, residuals, extremes of the axis track."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.flight.end_state import aspects
from nutdamp.flight.propagation import Flight
from nutdamp.flight.track import Extremes
from nutdamp.planning.decision import Simulation
from nutdamp.planning.notes import model_warnings
from nutdamp.views.decisions import decision_table, requirement
from nutdamp.views.end_tables import FRAME_N, add_aspects, angle_names, angle_texts, blocks_screen
from nutdamp.views.layout import columns, facts
from nutdamp.views.notes import screen_line
from nutdamp.views.plan_tables import header
from nutdamp.views.pulses import pulse_table, shown_rows
from nutdamp.views.text import degrees, longitude, moment, pointing, quantity


def simulation_screen(simulation: Simulation) -> RenderableType:
    """All tables of ``simulate``."""
    flight, extremes, decided = simulation.shown, simulation.extremes, simulation.decision
    impulses, flown, pulses = simulation.impulses, simulation.flown, len(simulation.plan.pulses)
    how = f"{simulation.plan.scheme}, propagated by the {flight.model}"
    parts: list[RenderableType] = [header(flight.spacecraft), Text(), Text(how, style="bold")]
    if len(flight.schedule) < pulses:
        begun = f"{len(flight.schedule) or 'none'} of {pulses} pulses begun"
        parts.append(Text(f"the track ends at {moment(extremes.until)}, with {begun}"))
    if flight.schedule.blocks:
        parts += [Text(), blocks_screen(flight, simulation.plan.delta_v)]
    if len(flight.schedule):
        pulses_table = pulse_table(flight)
        shown = shown_rows(pulses_table, flight.schedule.blocks)
        parts += [Text(), shown.screen("simulate")]
        if len(shown.rows) < len(flight.schedule):
            parts.append(Text(f"{len(shown.rows)} of {len(flight.schedule)} pulses; --json writes all.", style="dim"))
    parts += [Text(), _ends(impulses, flown, extremes.until)]
    if flight.spacecraft.attitude is None:
        parts.append(Text(f"{FRAME_N}.", style="dim"))
    parts += map(screen_line, model_warnings(impulses, flown))
    parts += [Text(), *requirement(decided), decision_table(decided)]
    parts += [Text(), _extremes(extremes, flight)]
    return Group(*parts)


def _ends(impulses: Flight, flown: Flight, until: float) -> Table:
    """Residuals and directions of both models at ``until`` s."""
    body = flown.spacecraft
    table = columns(f"at {moment(until)}", "by impulses (17)", "flown, real widths")
    rows = [
        ("nutation", "nutation"),
        ("body cone", "body_cone"),
        ("space cone", "space_cone"),
        ("momentum shift", "momentum_shift"),
    ]
    if body.goal.axis is not None:
        rows.append(("off the target", "axis_error"))
    both = (impulses, flown)
    for name, key in rows:
        table.add_row(Text(name, style="dim"), *(degrees(getattr(end.residual, key)) for end in both))
    for what, key in (("spin axis", "axis"), ("H", "momentum")):
        angles = (angle_texts(body, getattr(end.final, key)) for end in both)
        for name, *texts in zip(angle_names(body), *angles, strict=True):
            table.add_row(Text(f"{what}: {name}", style="dim"), *texts)
    table.add_row(Text("spin", style="dim"), *(quantity(end.final.spin, "rad/s", 6) for end in both))
    return table


def _extremes(extremes: Extremes, flight: Flight) -> Table:
    table = facts()
    far, near = extremes.farthest, extremes.nearest
    table.add_row(
        "spin axis from H(0)", f"{degrees(near[0])} at {moment(near[1])} to {degrees(far[0])} at {moment(far[1])}"
    )
    table.add_row("spin axis in x, in y", f"{_range(extremes.x)}, {_range(extremes.y)} of the inertial frame")
    given = flight.spacecraft.attitude
    if given is not None:
        frame = given.frame or "the frame of the file"
        west, east = map(longitude, extremes.right_ascension)
        table.add_row("right ascension", f"{west.removesuffix(' deg')} to {east} in {frame}, from its axis x towards y")
        table.add_row("declination", _range(extremes.declination))
    add_aspects(table, aspects(flight, extremes.until))
    table.add_row("track", f"{extremes.rows} rows, 0 to {moment(extremes.until)}")
    return table


def _range(values: tuple[float, float]) -> str:
    low, high = map(pointing, values)
    return f"{low.removesuffix(' deg')} to {high}"

"""The simulation of a schedule: ends of both models, cone angles around each pulse, extremes of the axis track."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any, NamedTuple

from rich.console import RenderableType
from rich.text import Text

from nutdamp.flight import end_state
from nutdamp.flight.end_state import aspects
from nutdamp.flight.propagation import Flight
from nutdamp.physics.attitude import full_turn
from nutdamp.planning.decision import Simulation
from nutdamp.planning.notes import decision_notes, model_warnings
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.decisions import cost, margin_lines, statement
from nutdamp.views.plan_json import aspects_json, decision_json, final_json, heading, residual_json, target_json
from nutdamp.views.pulses import pulse_table, shown_rows
from nutdamp.views.spacecraft import FRAME_N, angle_names, angle_texts, aspect_facts
from nutdamp.views.summary import Remark, blocks_screen, opening, summary, warnings_of
from nutdamp.views.tables import TEXT, Column, DataTable, Shared, facts
from nutdamp.views.text import degrees, longitude, moment, pointing

IMPULSES, WIDTHS = "impulse approximation (17)", "full simulation"
"""Names of the two models."""


class ModelEnd(NamedTuple):
    """The end of a flight by one of the models."""

    model: str
    flight: Flight


def _direction(name: str, at: int) -> Callable[[ModelEnd], str]:
    return lambda row: angle_texts(row.flight.spacecraft, getattr(row.flight.final, name))[at]


def _columns(body: Spacecraft) -> Iterator[Column]:
    yield Column("", "model", "", lambda row: row.model, where="screen", kind=TEXT)
    for name in ("nutation", "body_cone", "space_cone", "momentum_shift"):
        yield Column("", name.replace("_", " "), "", attrgetter(f"flight.residual.{name}"), degrees, "screen")
    if body.goal.axis is not None:
        yield Column("", "axis error", "", attrgetter("flight.residual.axis_error"), degrees, "screen")
    for heading_, name in (("spin axis", "axis"), ("H", "momentum")):
        for at, angle in enumerate(angle_names(body)):
            yield Column("", f"{heading_}: {angle}", "", _direction(name, at), where="screen")
    yield Column("", Shared.SPIN, "rad/s", lambda row: row.flight.final.spin, lambda spin: f"{spin:.6g}", "screen")


def end_comparison(simulation: Simulation) -> DataTable:
    """Residuals and directions at the end by both models."""
    rows = ModelEnd(IMPULSES, simulation.impulses), ModelEnd(WIDTHS, simulation.flown)
    columns = tuple(_columns(simulation.flown.spacecraft))
    return DataTable("Final state by both models", columns, rows)


def simulation_screen(simulation: Simulation, *, verbose: bool = True) -> RenderableType:
    """The screen of ``simulate``."""
    decided, body, extremes = simulation.decision, simulation.flown.spacecraft, simulation.extremes
    (_, spent), (_, end) = cost(decided)
    fired = f"{spent}, last ends at {end}" if len(simulation.flown.schedule) else "no pulse"
    track = f"track by the {simulation.shown.model}, 0 to {moment(extremes.until)}"
    headline = Text.assemble("SIMULATED ", (simulation.plan.scheme, "bold"), f": {fired}; {track}")
    head = [*opening(body, verbose), headline]
    head += warnings_of([*_cut(simulation), *model_warnings(simulation.impulses, simulation.flown)])
    near, far = (f"{degrees(angle)} at {moment(at)}" for angle, at in (extremes.nearest, extremes.farthest))
    remarks: list[Remark] = [*decision_notes(decided), f"spin axis from H(0): min {near}, max {far}"]
    return summary(
        [*head, statement(decided), *margin_lines(decided)],
        lambda **_: end_comparison(simulation).transposed("screen", f"end of track, {moment(extremes.until)}"),
        [*remarks, *[FRAME_N] * (body.attitude is None)],
        "--csv track.csv · --plot motion.png · nutdamp verify",
        more=[*_fired(simulation), facts(_extremes(simulation))] if verbose else (),
        verbose=verbose,
    )


def _cut(simulation: Simulation) -> Iterator[str]:
    """Warning of a track that ends before the schedule does."""
    begun, pulses = len(simulation.shown.schedule), len(simulation.plan.pulses)
    if begun < pulses:
        yield f"the track ends at {moment(simulation.extremes.until)}, with {begun or 'none'} of {pulses} pulses begun"


def _fired(simulation: Simulation) -> Iterator[RenderableType]:
    """Blocks and pulses of the track."""
    flight, schedule = simulation.shown, simulation.shown.schedule
    if schedule.blocks:
        yield blocks_screen(flight, simulation.plan.delta_v)
    if len(schedule):
        shown = shown_rows(pulse_table(flight), schedule.blocks)
        yield shown.screen("simulate")
        if len(shown.rows) < len(schedule):
            yield Text(f"{len(shown.rows)} of {len(schedule)} pulses; --json writes all.", style="dim")


def _extremes(simulation: Simulation) -> Iterator[tuple[str, str]]:
    extremes, body = simulation.extremes, simulation.shown.spacecraft
    yield "spin axis in x, in y", f"{_range(extremes.x)}, {_range(extremes.y)} of the inertial frame"
    if body.attitude is not None:
        frame = body.attitude.frame or "the frame of the file"
        west, east = map(longitude, extremes.right_ascension)
        yield "right ascension", f"{west.removesuffix(' deg')} to {east} in {frame}, from its axis x towards y"
        yield "declination", _range(extremes.declination)
    yield from aspect_facts(aspects(simulation.shown, extremes.until))
    yield "track", f"{extremes.rows} rows, 0 to {moment(extremes.until)}"


def _range(values: tuple[float, float]) -> str:
    low, high = map(pointing, values)
    return f"{low.removesuffix(' deg')} to {high}"


def simulation_json(simulation: Simulation) -> dict[str, Any]:
    """Pulses with the cone angles around them, ends of both models, and extremes of the axis track in degrees."""
    flight, extremes, impulses, flown = simulation.shown, simulation.extremes, simulation.impulses, simulation.flown
    attitude = flight.spacecraft.attitude
    return {
        **heading(flight.spacecraft),
        "scheme": simulation.plan.scheme,
        "propagated": "flown" if simulation.real else "residual",
        "pulses": pulse_table(flight).json("flown"),
        "residual": residual_json(impulses.residual),
        "flown": residual_json(flown.residual),
        "final": final_json(flown),
        "final_by_impulses": final_json(impulses),
        "differ": [bound.part.value for bound in end_state.deviations(impulses, flown)],
        "target": target_json(flight.spacecraft),
        **aspects_json(aspects(flight, extremes.until)),
        "decision": decision_json(simulation.decision),
        "until_s": extremes.until,
        "axis_track": {
            "frame": "N" if attitude is None else attitude.frame,
            "farthest_from_momentum_deg": math.degrees(extremes.farthest[0]),
            "farthest_s": extremes.farthest[1],
            "nearest_to_momentum_deg": math.degrees(extremes.nearest[0]),
            "nearest_s": extremes.nearest[1],
            "x_deg": [math.degrees(value) for value in extremes.x],
            "y_deg": [math.degrees(value) for value in extremes.y],
            # Western and eastern end, for any range between.
            "right_ascension_deg": None
            if attitude is None
            else [math.degrees(full_turn(angle)) for angle in extremes.right_ascension],
            "declination_deg": None if attitude is None else [math.degrees(v) for v in extremes.declination],
        },
    }

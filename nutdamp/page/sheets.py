"""Results as the tables of pages and notebooks: one unit a column, so that they sort."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from nutdamp.flight.end_state import spin_phases
from nutdamp.flight.propagation import Residual
from nutdamp.page.document import Column, Sheet
from nutdamp.planning.decision import Comparison
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views import verdicts
from nutdamp.views.decisions import COUNT
from nutdamp.views.end_tables import angle_names, angle_texts
from nutdamp.views.plan_tables import MILLISECONDS, channel_text, flown_by, ratios
from nutdamp.views.text import MISSING, digits, in_degrees, longitude

Cell = Callable[[Plan], str]


def comparison_sheet(compared: Comparison) -> Sheet:
    """One row a scheme; the recommended one is marked. With dispersed cases the share that complies."""
    columns = _columns(compared)
    if compared.shares:
        columns.append((Column(COUNT, "%"), lambda plan: _share(compared, plan)))
    rows = []
    for plan in compared.plans:
        cells = [cell(plan) if plan.feasible else "" for _, cell in columns]
        rows.append((plan.scheme, *(cells if plan.feasible else [verdicts.no_plan(plan), *cells[1:]])))
    mark = next((index for index, plan in enumerate(compared.plans) if plan is compared.recommended), None)
    names = (Column("scheme", number=False), *(column for column, _ in columns))
    return Sheet(
        f"What each scheme costs and leaves with nominal values, by {flown_by(compared)}",
        names,
        tuple(rows),
        mark,
    )


def _columns(compared: Comparison) -> list[tuple[Column, Cell]]:
    columns: list[tuple[Column, Cell]] = [
        (Column("pulses"), lambda plan: str(len(plan.pulses))),
        (Column("ends at", "s", dots=True), lambda plan: f"{plan.pulses.end:.3f}"),
        (Column("impulse", "N m s", dots=True), lambda plan: _number(plan.pulses.total_impulse)),
        *((Column("impulse", name), cell) for name, cell in ratios(compared.spacecraft)),
    ]
    if any(plan.feasible and plan.pulses.propellant is not None for plan in compared.plans):
        columns.append((Column("propellant", "g", dots=True), lambda plan: _number(plan.pulses.propellant, 1e3)))
    columns += [
        (Column("nutation left", "deg", dots=True), lambda plan: _angle(plan.flown, "nutation")),
        (Column("shift of H", "deg", dots=True), lambda plan: _angle(plan.flown, "momentum_shift")),
    ]
    body = compared.spacecraft
    if body.goal.axis is not None:
        columns.append((Column("off the target", "deg", dots=True), lambda plan: _angle(plan.flown, "axis_error")))
    columns += [
        (Column(f"axis: {angle_names(body)[0]}", "deg"), lambda plan: _pointing(plan, 0)),
        (Column(f"axis: {angle_names(body)[1]}", "deg"), lambda plan: _pointing(plan, 1)),
    ]
    if any(plan.spin_change for plan in compared.plans):
        columns.append((Column("spin change", "rad/s"), lambda plan: _number(plan.spin_change)))
    if any(plan.delta_v is not None for plan in compared.plans):
        columns.append(
            (Column("ΔV", "m/s"), lambda plan: _number(None if plan.delta_v is None else math.hypot(*plan.delta_v)))
        )
    if requirements.required(compared.spacecraft):
        columns.append((Column("requirement", number=False), lambda plan: verdicts.VERDICT[compared.meets(plan)]))
    return columns


def _share(compared: Comparison, plan: Plan) -> str:
    return verdicts.share_text(compared.shares.get(plan)).removesuffix(" %")


def _number(value: float | None, scale: float = 1.0) -> str:
    return MISSING if value is None else digits(scale * value, 4) if value else "0"


def _pointing(plan: Plan, which: int) -> str:
    return angle_texts(plan.spacecraft, plan.flight.final.axis)[which].removesuffix(" deg")


def _angle(left: Residual | None, name: str) -> str:
    return MISSING if left is None else in_degrees(getattr(left, name))


def pulse_sheet(plan: Plan) -> Sheet:
    """One row a pulse: time, spin phase, duration, channel, and the cones before and after."""
    flown, pulses, body = plan.flight, plan.pulses.pulses, plan.spacecraft
    tracks = flown.around_pulses()
    phases = spin_phases(flown, np.array([pulse.loaded[0] for pulse in pulses]))
    dates = [body.utc(pulse.loaded[0], MILLISECONDS) for pulse in pulses]
    effective = [f"{pulse.on_time:.4f}" for pulse in pulses]
    columns: list[tuple[Column, list[str]]] = [
        (Column("pulse"), [str(index + 1) for index in range(len(pulses))]),
        (Column("start", "s"), [f"{pulse.loaded[0]:.4f}" for pulse in pulses]),
        *([(Column("start", "UTC", number=False), [date or MISSING for date in dates])] if any(dates) else []),
        (Column("spin phase", "deg"), [longitude(phase).removesuffix(" deg") for phase in phases.tolist()]),
        on_times(plan.pulses),
        *([(Column("on-time, effective", "s"), effective)] if plan.pulses.through_valves else []),
        (Column("channel", number=False), [channel_text(pulse, body) for pulse in pulses]),
        (Column("impulse", "N m s"), [digits(pulse.magnitude, 4) for pulse in pulses]),
    ]
    for cone in ("nutation", "body_cone", "space_cone"):
        for track, when in zip(tracks, ("before", "after"), strict=True):
            angles = [in_degrees(angle) for angle in getattr(track, cone).tolist()]
            columns.append((Column(f"{cone.replace('_', ' ')} {when}", "deg"), angles))
    rows = tuple(zip(*(cells for _, cells in columns), strict=True))
    return Sheet(f"Pulses of {plan.scheme}", tuple(column for column, _ in columns), rows)


def on_times(pulses: Schedule) -> tuple[Column, list[str]]:
    """The column of on-times to be loaded; its name tells where valves change them."""
    name = "on-time, commanded" if pulses.through_valves else "on-time"
    return Column(name, "s"), ["ideal" if pulse.loaded[1] == 0.0 else f"{pulse.loaded[1]:.4f}" for pulse in pulses]


def residual_sheet(title: str, left: Residual) -> Sheet:
    """Residual motion at the end of a flight."""
    names = {
        "nutation": "nutation",
        "body cone": "body_cone",
        "space cone": "space_cone",
        "shift of H": "momentum_shift",
    }
    rows = tuple((name, _angle(left, key)) for name, key in names.items())
    return Sheet(title, (Column("at the end", number=False), Column("angle", "deg")), rows)

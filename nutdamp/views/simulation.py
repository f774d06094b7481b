"""The simulation of a schedule and its verification: ends, cone angles around each pulse, extremes
of the axis track.

Also the schedule spin by spin. Where the file has a Sun sensor a spin begins with its pulse, 1 with
the first one, as in command blocks; the time before that is spin 0. Else spin 1 begins at t = 0,
and in each ∫ω3 dt grows by 2π.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.common.results import Note, note
from nutdamp.errors import BadRequest
from nutdamp.files.tabular import number
from nutdamp.flight import end_state, propagation
from nutdamp.flight.cones import aspects
from nutdamp.flight.propagation import IMPULSE_SUM, REAL_WIDTHS, Flight
from nutdamp.flight.verification import AGREE, AS_FLOWN, IDEAL, WITHOUT, Conservation, Verification
from nutdamp.physics.attitude import angle_between, full_turn
from nutdamp.planning.notes import TELLING, verdict_notes
from nutdamp.planning.plan import Plan
from nutdamp.planning.simulation import Simulation, Verified, model_warnings
from nutdamp.planning.verdict import Light
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.views import decisions, parts, tables
from nutdamp.views import verdict as verdicts
from nutdamp.views.tables import (
    TEXT,
    WHOLE,
    Column,
    DataTable,
    Shared,
    angle_of,
    facts,
    to_figures,
)
from nutdamp.views.text import (
    degrees,
    mass,
    moment,
    quantity,
    small_angle,
)

MODELS = {
    IMPULSE_SUM: "impulse approximation (17)",
    REAL_WIDTHS: "full simulation",
}  # names of the two models


def _end_table(simulation: Simulation) -> DataTable:
    """End of the track by both models, of which one is that of the track."""
    spacecraft = simulation.flown.spacecraft

    def direction(name: str, angle: Column) -> Callable[[Flight], str]:
        return lambda flight: angle.worded(getattr(flight.final, name))

    def model(flight: Flight) -> str:
        name = MODELS[flight.model]
        return f"{name}, track" if flight.model == simulation.shown.model else name

    residuals = parts.RESIDUALS[: None if spacecraft.goal.axis is not None else -1]
    columns = [
        Column("", "model", "", model, where="screen", kind=TEXT),
        *(
            Column(
                "", name.replace("_", " "), "", attrgetter(f"residual.{name}"), degrees, "screen"
            )
            for name in residuals
        ),
        *(
            Column("", f"{heading}: {angle.heading}", "", direction(name, angle), where="screen")
            for heading, name in (("spin axis", "axis"), ("H", "momentum"))
            for angle in parts.direction_columns(spacecraft)
        ),
        Column("", Shared.SPIN, "rad/s", attrgetter("final.spin"), to_figures(6), "screen"),
    ]
    return DataTable("", columns, (simulation.impulses, simulation.flown))


def simulation_screen(
    simulation: Simulation, *, verbose: bool = True, planned: Sequence[Note] = ()
) -> RenderableType:
    """The screen of ``simulate``; ``planned``: notes on the plan that it flies."""
    judged, extremes = simulation.verdict, simulation.extremes
    spacecraft = simulation.flown.spacecraft
    pulses = simulation.flown.schedule
    fired = verdicts.fired(pulses) if len(pulses) else "no pulse"
    headline = Text.assemble("SIMULATED ", (simulation.plan.scheme, "bold"), f": {fired}")
    head = [
        *decisions.opening(spacecraft, verbose),
        headline,
        verdicts.coloured(*verdicts.stated(judged)),
    ]
    head += [verdicts.bound_table(judged).screen("screen")] if judged.lines else []
    ends = _end_table(simulation)
    verify = "nutdamp verify"
    if simulation.plan._from_file:
        kind = "blocks" if simulation.plan.pulses.blocks else "schedule"
        verify += f" --{kind} {shlex.quote(simulation.plan.scheme)}"
    until = moment(extremes.until)
    track = f"{extremes.rows} rows, 0 to {until}, by the {simulation.shown.model}"
    watched = parts.aspect_facts(aspects(simulation.shown, extremes.until)) if verbose else ()
    more = [*_fired(simulation), facts([*watched, ("track", track)])] if verbose else []
    return parts.Summary(
        head,
        lambda **_: [ends.transposed("screen", f"end of track, {until}"), *more],
        [*_notes(simulation), *planned],
        parts.STEP.join(["--csv track.csv", "--plot motion.png", verify]),
        verbose,
    )


def _notes(simulation: Simulation) -> Iterator[Note]:
    extremes = simulation.extremes
    begun = len(simulation.shown.schedule)
    pulses = len(simulation.plan.pulses)
    if begun < pulses:
        yield note("track-cut", until_s=extremes.until, begun=begun, pulses=pulses)
    judged = simulation.plan._flight.residual.nutation
    if begun == pulses > 0 and abs(simulation.flown.residual.nutation - judged) > TELLING:
        yield note(
            "judged-at-end",
            judged_s=simulation.plan.pulses.end,
            nutation_deg=math.degrees(judged),
            until_s=extremes.until,
        )
    yield from model_warnings(simulation.impulses, simulation.flown)
    yield from verdict_notes(simulation.verdict, simulation.plan)
    (near, near_at), (far, far_at) = extremes.nearest, extremes.farthest
    near, far = math.degrees(near), math.degrees(far)
    yield note(
        "axis-track", nearest_deg=near, nearest_s=near_at, farthest_deg=far, farthest_s=far_at
    )
    if simulation.flown.spacecraft.attitude is None:
        yield note("frame-n")


def _fired(simulation: Simulation) -> Iterator[RenderableType]:
    flight, schedule = simulation.shown, simulation.shown.schedule
    if schedule.blocks:
        yield from blocks_screen(simulation.plan)
    if len(schedule):
        table, numbers = parts.pulse_table(flight), set[int]()
        for own in schedule.pulses_by_block:
            step = max(math.ceil((len(own) - 1) / (EVENLY - 1)), 1)
            numbers |= {*own[::step], own[-1]}
        # a track may end before the last one
        rows = [table.rows[index] for index in sorted(numbers) if index < len(table.rows)]
        yield replace(table, rows=rows).screen("simulate")
        if len(rows) < len(schedule):
            yield Text(f"{len(rows)} of {len(schedule)} pulses; --json writes all.", style="dim")


def blocks_screen(plan: Plan) -> Iterator[RenderableType]:
    """The command blocks of a plan, and what an operator compares before and after them."""
    table = parts.block_table(plan._flight)
    yield Text(table.title, style="bold")
    yield table.screen("screen")
    yield Text()
    yield facts(_effects(plan))


def _effects(plan: Plan) -> Iterator[tuple[str, str]]:
    spacecraft, final = plan.spacecraft, plan._flight.final
    for column in parts.direction_columns(spacecraft):
        begin, end = map(column.worded, (spacecraft.momentum, final.momentum))
        yield f"H: {column.heading}", f"{begin} to {end}"
    if spacecraft.sun is not None:
        sides = (spacecraft.momentum, final.momentum)
        angles = (degrees(float(angle_between(side, spacecraft.sun))) for side in sides)
        yield "Sun angle of H", " to ".join(angles)
    yield Shared.SPIN, f"{parts.spin_text(spacecraft.spin)} to {parts.spin_text(final.spin)}"
    used, tank = plan.pulses.propellant, spacecraft.tank
    left = "" if used is None or tank is None else f"; {mass(tank.propellant - used)} left"
    yield Shared.PROPELLANT, f"{verdicts.spent(plan.pulses)}{left}"
    if plan._delta_v is not None:
        yield "|ΔV|", quantity(float(np.linalg.norm(plan._delta_v)), "m/s")


# largest number of pulses of a block on a screen: the first, the last, and evenly some between
EVENLY = 8


def simulation_json(simulation: Simulation) -> dict[str, Any]:
    """Pulses with the cone angles around them, ends of both models, and extremes of the axis track
    in degrees.
    """
    flight, extremes = simulation.shown, simulation.extremes
    impulses, flown = simulation.impulses, simulation.flown
    attitude = flight.spacecraft.attitude
    around, above = "right_ascension_deg", "declination_deg"
    if attitude is not None:
        around, above = (column.key for column in parts.direction_columns(flight.spacecraft))
    return {
        **decisions.heading(flight.spacecraft),
        "scheme": simulation.plan.scheme,
        "propagated": "flown" if simulation.real else "residual",
        "pulses": parts.pulse_table(flight).json("flown"),
        "residual": decisions.residual_json(impulses.residual),
        "flown": decisions.residual_json(flown.residual),
        "final": decisions.final_json(flown),
        "final_by_impulses": decisions.final_json(impulses),
        "differ": [bound.part.value for bound in end_state.deviations(impulses, flown)],
        "target": decisions.target_json(flight.spacecraft),
        **decisions.aspects_json(aspects(flight, extremes.until)),
        "decision": decisions.decision_json(simulation.verdict),
        "until_s": extremes.until,
        "judged_s": simulation.plan.pulses.end or None,
        "axis_track": {
            "frame": "N" if attitude is None else attitude.frame,
            "farthest_from_momentum_deg": math.degrees(extremes.farthest[0]),
            "farthest_s": extremes.farthest[1],
            "nearest_to_momentum_deg": math.degrees(extremes.nearest[0]),
            "nearest_s": extremes.nearest[1],
            "x_deg": [*map(math.degrees, extremes.x)],
            "y_deg": [*map(math.degrees, extremes.y)],
            # Western and eastern end, for any range between.
            around: attitude
            and [math.degrees(full_turn(angle)) for angle in extremes.right_ascension],
            above: attitude and [*map(math.degrees, extremes.declination)],
        },
    }


BETWEEN = "; "  # separator of the values of several pulses in one spin
MOST_SPINS = 100_000  # largest number of spins: more make no table that anyone reads
DIGITS = 9  # decimals of seconds and degrees that are written
# share of a spin after t = 0 within which the first Sun pulse comes at once: no spin is before it
SAME = 1e-9
GRID = 4  # times in each turn between which its begin is interpolated before it is refined
NEWTON = 3  # Newton steps to the begin of a turn: the second one is at rounding already


class SpinRow(NamedTuple):
    """A spin by its number, with its date, begin and period, s, and the pulses commanded in it with
    their phases, deg.
    """

    number: int
    utc: str | None
    begin: float
    period: float
    fired: list[tuple[Pulse, float]]


def _several(value: Callable[[Pulse, float], float]) -> Callable[[SpinRow], str]:
    return lambda row: BETWEEN.join(number(round(value(*pulse), DIGITS)) for pulse in row.fired)


SPINS = (
    Column.named("spin=number", "", "", where="csv", kind=WHOLE),
    Column.named("start_utc=utc", "", "", where="csv", kind=TEXT),
    Column("start_s", "", "", lambda row: round(row.begin, DIGITS), where="csv"),
    Column("period_s", "", "", lambda row: round(row.period, DIGITS), where="csv"),
    Column("pulses", "", "", lambda row: len(row.fired), where="csv", kind=WHOLE),
    Column(
        "channel",
        "",
        "",
        lambda row: BETWEEN.join(pulse.channel for pulse, _ in row.fired),
        where="csv",
        kind=TEXT,
    ),
    Column(
        "phase_deg",
        "",
        "",
        _several(lambda _, phase: phase),
        where="csv",
        kind=TEXT,
    ),
    Column("on_time_s", "", "", _several(lambda pulse, _: pulse.loaded[1]), where="csv", kind=TEXT),
)


def spin_table(spacecraft: Spacecraft, schedule: Schedule, until: float) -> str:
    """The spins from t = 0 to ``until`` s as CSV, those after that to the last pulse too; the last
    one is whole.

    ``phase_deg`` is the angle, 0 to below 360, by which the body has turned about axis 3 in its
    spin, as a pulse is commanded; with a Sun sensor that since the Sun pulse. ``on_time_s`` is the
    length of the command. Without an epoch ``start_utc`` is empty. Raises BadRequest for more than
    `MOST_SPINS`, Infeasible where the sensor does not see the Sun.
    """
    last = max(until, max((pulse.loaded[0] for pulse in schedule), default=0.0))
    if last * abs(spacecraft.spin) > 2.0 * math.pi * MOST_SPINS:
        raise BadRequest(
            f"the table would have more than {MOST_SPINS} turns; choose an earlier end (until)"
        )
    first, begins = _begins(spacecraft, schedule, last)
    ends = begins[1:]
    periods = np.diff(begins)
    if first == 0:  # the rest of a spin, which began before t = 0
        periods[0] = periods[1]
    sense = 1.0 if parts.sun_phased(spacecraft) else math.copysign(1.0, spacecraft.spin)
    turned = sense * parts.phases(propagation.flown(spacecraft, schedule, last))
    fired: dict[int, list[tuple[Pulse, float]]] = {}
    for pulse, angle in zip(schedule, np.degrees(turned).tolist(), strict=True):
        phase = round(angle % 360.0, DIGITS) % 360.0
        spin = min(int(np.searchsorted(ends, pulse.loaded[0], "right")), len(ends) - 1)
        # A pulse at the very end of a spin, with a phase rounded to 0, is in the next one.
        passed = 1.0 - (ends[spin] - pulse.loaded[0]) / periods[spin]
        fired.setdefault(spin + round(passed - phase / 360.0), []).append((pulse, phase))
    latest = max(int(np.searchsorted(begins, last, "right")) - 1, *fired, 0)
    rows = [
        SpinRow(first + index, spacecraft.utc(begin), begin, periods[index], fired.get(index, []))
        for index, begin in enumerate(begins[:-1][: latest + 1].tolist())
    ]
    return DataTable("Spins", SPINS, rows).csv()


def _begins(spacecraft: Spacecraft, schedule: Schedule, last: float) -> tuple[int, Vector]:
    """Number of the first spin, and begins of it and those after it, s: to after ``last``, and
    three at least.
    """
    from nutdamp.schemes.block_model import spin_turn, sun_pulses

    if spacecraft.spin == 0.0:
        raise BadRequest("a table of turns needs a body that spins")
    turn, sunlit = spin_turn(spacecraft), parts.sun_phased(spacecraft)
    until = last + 3.0 * turn
    for _ in range(2):  # where the spin falls, turns get longer
        flown = propagation.flown(spacecraft, schedule, until)
        first = 1
        begins = sun_pulses(flown, until) if sunlit else _turns(flown, until)
        if sunlit and not (len(begins) and begins[0] < SAME * turn):
            first, begins = 0, np.append(0.0, begins)
        if len(begins) > 2 and begins[-1] > last:
            return first, begins
        slowest = max(abs(flown.settled.spin), 1e-3 * abs(spacecraft.spin))
        until = last + 12.0 * math.pi / slowest
    raise BadRequest(f"no whole spin ends after {last:.4g} s: the spin comes to a halt")


def _turns(flown: Flight, until: float) -> Vector:
    """Times of 0, 1, 2, … turns of the body about axis 3, up to ``until`` s, (n,); none after the
    spin ends.
    """
    spin = flown.spacecraft.spin
    sense = math.copysign(1.0, spin)
    times = np.linspace(0.0, until, math.ceil(GRID * until * abs(spin) / (2.0 * math.pi)) + 2)
    turned = sense * end_state.spin_phases(flown, times)
    ascending = np.append(True, np.logical_and.accumulate(np.diff(turned) > 0.0))
    times, turned = times[ascending], turned[ascending]
    whole = 2.0 * math.pi * np.arange(math.floor(turned[-1] / (2.0 * math.pi)) + 1)
    begins = np.interp(whole, turned, times)
    for _ in range(NEWTON):
        rates = sense * flown.motion(begins)[0][:, 2]
        begins += (whole - sense * end_state.spin_phases(flown, begins)) / rates
        begins = np.clip(begins, 0.0, times[-1])
    return np.asarray(begins)


SHOWN = 1e-9 * math.pi / 180.0  # rad; smaller differences are shown as rounding
BUDGET = "Error budget: what each imperfection leaves, alone"  # the title of `budget_table`
BUDGET_NOTE = (  # note on `budget_table`
    "The rows do not add up, because a plan is tuned to all effects together. A "
    "row 'without' shows what the same pulses leave without that effect."
)


def verification_screen(
    verified: Verified, *, verbose: bool, planned: Sequence[Note] = ()
) -> RenderableType:
    """The screen of ``verify``: verdict, methods, and what each imperfection leaves; ``planned``:
    notes on the plan that it flies.
    """
    plan, verification = verified.plan, verified.core
    spacecraft, judged = plan.spacecraft, plan.verdict
    confirmed = Light.GREEN if verification.agree else Light.RED
    lead, about = verdicts.headline(judged)
    head: list[RenderableType] = [
        parts.named(spacecraft, f": {plan.scheme}"),
        verdicts.coloured(verdict(verification), confirmed),
        Text.assemble((lead, verdicts.STYLES[judged.light]), about),
        verdicts.coloured(verdicts.statement(judged), judged.light),
    ]
    missing = [
        note("method-missing", method=method.name, why=method.missing)
        for method in verification.methods
        if method.missing
    ]
    notes = [conservation(verification), *missing, *planned]
    # The imperfection that leaves the most nutation alone, where one leaves more than ideal
    # impulses; the budget shows them all.
    single = [
        row
        for row in verification.budget
        if row.name not in (IDEAL, AS_FLOWN) and WITHOUT not in row.name
    ]
    worst = max(single, key=lambda row: row.nutation, default=None)
    least = verification.budget[0].nutation
    if not verbose and worst is not None and worst.nutation - least > SHOWN:
        angle = math.degrees(worst.nutation)
        notes.insert(1, note("largest-imperfection", imperfection=worst.name, nutation_deg=angle))
    tables: list[RenderableType] = [methods_table(verification).screen("screen")]
    if verbose:
        head += [Text(), decisions.derived_table(spacecraft)]
        budget = budget_table(spacecraft, verification).screen("screen")
        tables.append(Group(Text(BUDGET, "bold"), Text(), budget, Text(BUDGET_NOTE, "dim")))
    return parts.Summary(head, lambda **_: tables, notes, "--json verified.json", verbose)


def verification_json(verified: Verified) -> dict[str, Any]:
    """Methods with their differences from the flown motion (rad), conservation, error budget."""
    flown, verification = verified.plan._flight, verified.core
    spacecraft = flown.spacecraft
    return {
        **decisions.heading(spacecraft),
        "scheme": verified.plan.scheme,
        "agree": verification.agree if verification.checks else None,
        "disagreeing": list(verification.disagreeing),
        "final": decisions.final_json(flown),
        "target": decisions.target_json(spacecraft),
        "methods": DataTable("", METHODS, verification.methods).json(),
        **tables.values_of(
            verification, "momentum_drift=momentum.drift", "momentum_kept=momentum.kept"
        ),
        **tables.values_of(verification, "energy_drift=energy.drift", "energy_kept=energy.kept"),
        "budget": budget_table(spacecraft, verification).json(),
    }


def _difference(value: float) -> str:
    return f"{value:.1e}" if value >= 1e-12 else "0"  # less is rounding


NUTATION = Column.named("nutation_deg", Part.NUTATION.label, "deg", small_angle, "json screen")
METHODS = (
    Column.named("name", "method", "", where="json screen", kind=TEXT),
    NUTATION,
    Column.named("momentum_shift_deg", Part.SHIFT.label, "deg", small_angle, "json screen", rank=1),
    Column.named("axis_difference_rad=axis", "Δaxis", "rad", _difference, "json screen"),
    Column.named("momentum_difference_rad=momentum", "ΔH", "rad", _difference, "json screen"),
    Column.named("rate_difference=rate", "Δrates", "relative", _difference, "json screen", rank=2),
    Column.named("result_difference=result", "", "", where="json"),
    Column("missing", "", "", lambda row: row.missing or None, where="json", kind=TEXT),
)
IMPERFECTIONS = (
    Column.named(
        "imperfection=name",
        "imperfection",
        "",
        where="json screen",
        kind=TEXT,
        words=lambda row: row.name.replace("pulse width", Shared.ON_TIME),
    ),
    NUTATION,
    *tables.file_columns("json", "momentum_shift_deg"),
    Column("", Part.SHIFT.label, "deg", angle_of("momentum_shift"), small_angle, "screen",
           lambda body: body.goal.axis is None),
    *tables.file_columns("json", "axis_error_deg"),
    Column("", Part.DISTANCE.label, "deg", angle_of("axis_error"), small_angle, "screen",
           lambda body: body.goal.axis is not None),
)  # fmt: skip


def methods_table(verification: Verification) -> DataTable:
    """One row a way to fly the schedule: its residuals,
    and its difference from the flown motion.
    """
    rows = [method for method in verification.methods if not method.missing]
    return DataTable("Maximum differences from the flown motion", METHODS, rows)


def budget_table(spacecraft: Spacecraft, verification: Verification) -> DataTable:
    """One row an imperfection: residuals with it alone; then residuals without each effect that
    plans include.
    """
    return DataTable(BUDGET, IMPERFECTIONS, verification.budget, spacecraft)


def verdict(verification: Verification) -> str:
    """Sentence whether the integrations from outside confirm the flown motion."""
    if not verification.checks:
        return "NOT CONFIRMED: no independent integration was flown to the end."
    names, how = (
        (verification.checks, "agree")
        if verification.agree
        else (verification.disagreeing, "DO NOT AGREE")
    )
    return f"The flown motion and {' and '.join(names)} {how} (within {AGREE:g} rad)."


def conservation(verification: Verification) -> Note:
    """The change of |H| and of the energy on coasts, and its cause."""
    return note(
        "on-coasts", momentum=_course(verification.momentum), energy=_course(verification.energy)
    )


def _course(course: Conservation) -> str:
    how = f"changed by {' and '.join(course.changed)}" if course.changed else "constant to rounding"
    how = "NOT constant" if course.kept is False else how
    drift = _difference(course.drift)
    return how if drift == "0" else f"{how} (by {drift} of itself at most)"

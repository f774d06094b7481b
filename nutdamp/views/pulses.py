"""Pulses and command blocks of a schedule: one row each, on screens, pages, the manoeuvre sheet and in files.

Plans, decisions, certificates and spacecraft as JSON-ready dictionaries: vectors in the axes of the file, degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nutdamp import __version__
from nutdamp.common.numerics import cleaned
from nutdamp.flight.end_state import Aspect, spin_phases
from nutdamp.flight.propagation import Flight, Residual, Track
from nutdamp.planning.decision import Comparison, Decision, Line, decide, infeasibility
from nutdamp.planning.notes import alternatives, comparison_warnings, decision_notes, plan_notes, reasons
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.spacecraft.schedule import STEERABLE, Pulse, Schedule
from nutdamp.views.decisions import verdict
from nutdamp.views.tables import TEXT, WHOLE, Column, DataTable, Shared, angle_of
from nutdamp.views.text import digits, joined, longitude, note_json, short_angle, small_angle, steering

if TYPE_CHECKING:
    from nutdamp.planning.tradeoff import Certificate
    from nutdamp.schemes.optimal.linear_program import Burn


MILLISECONDS = 3
"""Digits of a second that tables show of a date."""


class PulseRow(NamedTuple):
    """A pulse of ``body``, counted from 0; motion just before and after all pulses; spin phase at its start, rad."""

    at: int
    pulse: Pulse
    body: Spacecraft
    before: Track | None = None
    after: Track | None = None
    phase: float = 0.0


def channel_text(pulse: Pulse, body: Spacecraft) -> str:
    """The channel of a pulse; a steerable one is named by the angle of its torque too."""
    if pulse.channel != STEERABLE:
        return pulse.channel
    return f"{STEERABLE} {steering(body.inertia.in_file(pulse.impulse).tolist())}"


def seconds(value: float) -> str:
    """A time within a schedule to a tenth of a millisecond."""
    return f"{value:.4f}"


def on_time(value: float) -> str:
    """An on-time; an impulse that takes none is ideal."""
    return seconds(value) if value else "ideal"


def clock(date: str) -> str:
    """Month, day and time of a date in UTC, for columns with little room."""
    return date[5:].replace("T", " ").removesuffix("Z")


def _cone(name: str, when: str, where: str) -> Column:
    def angle(row: PulseRow) -> float:
        return math.degrees(getattr(getattr(row, when), name)[row.at])

    return Column(f"{name}_{when}_deg", f"{name.replace('_', ' ')} {when}", "deg", angle, small_angle, where)


def _vector(name: str, unit: str) -> Column:
    def components(row: PulseRow) -> Any:
        vector = getattr(row.pulse, name)
        return None if vector is None else row.body.inertia.in_file(vector)

    return Column(f"{name}#_{unit}", name, unit, components, where="csv json flown")


def _date(row: PulseRow) -> str | None:
    return row.body.utc(row.pulse.loaded[0], MILLISECONDS)


def _valves(schedule: Schedule) -> bool:
    return schedule.through_valves


PULSES = (
    Column("pulse", "pulse", "", lambda row: row.at + 1, where="screen full simulate page csv", kind=WHOLE),
    Column("t_s", "centre", "s", lambda row: row.pulse.t, seconds, "csv json flown"),
    Column(
        "start_s",
        Shared.START,
        "s",
        lambda row: row.pulse.loaded[0],
        seconds,
        "screen full simulate page csv json flown",
    ),
    Column("", Shared.START, "UTC", _date, clock, "full", kind=TEXT),
    Column("", Shared.START, "UTC", _date, where="page", kind=TEXT),
    Column("", "spin phase", "deg", lambda row: row.phase, lambda phase: longitude(phase).removesuffix(" deg"), "page"),
    Column(
        "on_time_s",
        Shared.ON_TIME,
        "s",
        lambda row: row.pulse.loaded[1],
        on_time,
        "screen full simulate page csv json flown",
    ),
    Column("", Shared.EFFECTIVE, "s", lambda row: row.pulse.on_time, seconds, "full page", _valves),
    Column("", Shared.CHANNEL, "", lambda row: channel_text(row.pulse, row.body), where="screen full simulate page",
           kind=TEXT),
    Column("channel", Shared.CHANNEL, "", lambda row: row.pulse.channel, where="csv json flown", kind=TEXT),
    _vector("torque", "Nm"),
    _vector("impulse", "Nms"),
    Column("propellant_kg", Shared.PROPELLANT, "kg", lambda row: row.pulse.propellant, where="csv json flown"),
    Column("", Shared.IMPULSE, "N m s", lambda row: row.pulse.magnitude, lambda size: digits(size, 4), "full page"),
    _cone("nutation", "before", "full simulate page csv flown"),
    _cone("nutation", "after", "full simulate page csv flown"),
    _cone("body_cone", "before", "page flown"),
    _cone("body_cone", "after", "simulate page flown"),
    _cone("space_cone", "before", "page flown"),
    _cone("space_cone", "after", "simulate page flown"),
    Column("effective_start_s", "", "", lambda row: row.pulse.start, where="csv json flown", when=_valves),
    Column("effective_on_time_s", "", "", lambda row: row.pulse.on_time, where="csv json flown", when=_valves),
    Column("utc", "", "", lambda row: row.body.utc(row.pulse.loaded[0]), where="csv json flown", kind=TEXT),
)  # fmt: skip


def commanded(schedule: Schedule, body: Spacecraft) -> DataTable:
    """The pulses as they are commanded, without the motion that they cause."""
    rows = [PulseRow(index, pulse, body) for index, pulse in enumerate(schedule)]
    return DataTable("Pulses", _dated(body), rows, schedule)


def pulse_table(flown: Flight, *, scheme: str = "", least: float = math.inf) -> DataTable:
    """The pulses of a flight with the cone angles before and after each.

    ``scheme``: its name, for pages, which have spin phases too; ``least``: limit of the nutation, rad, of the default
    screen.
    """
    before, after = flown.around_pulses()
    pulses, body = flown.schedule.pulses, flown.spacecraft
    phases = spin_phases(flown, np.array([pulse.loaded[0] for pulse in pulses])) if scheme else np.zeros(len(pulses))
    rows = [
        PulseRow(index, pulse, body, before, after, phase)
        for index, (pulse, phase) in enumerate(zip(pulses, phases.tolist(), strict=True))
    ]
    left = Column("", Shared.NUTATION_AFTER, "deg", lambda row: float(row.after.nutation[row.at]),
                  lambda angle: short_angle(angle, least), "screen")  # fmt: skip
    return DataTable(f"Pulses of {scheme}", (*_dated(body), left), rows, flown.schedule)


def _dated(body: Spacecraft) -> tuple[Column, ...]:
    """The columns for a spacecraft: without an epoch there are none of dates."""
    dated = body.utc(0.0) is not None
    return PULSES if dated else tuple(column for column in PULSES if "UTC" not in (column.unit, column.key.upper()))


class BlockRow(NamedTuple):
    """A command block of ``body``, from 0: its pulses, the nutation after the last of them, rad."""

    at: int
    block: Block
    body: Spacecraft
    pulses: tuple[Pulse, ...]
    nutation: float


def _counts(name: str) -> Callable[[BlockRow], int | None]:
    def counted(row: BlockRow) -> int | None:
        commands = row.body.commands
        if commands is None:
            return None
        return commands.delay_counts(row.block.delay) if name == "delay" else commands.width_counts(row.block.width)

    return counted


def _nine(value: float) -> float:
    """A number to nine figures, without the noise of its last digits."""
    return float(f"{value:.9g}")


def _six(value: float) -> str:
    return f"{value:.6g}"


EVERYWHERE = "screen page csv"
BLOCKS = (
    Column("block", "block", "", lambda row: row.at + 1, where=EVERYWHERE, kind=WHOLE),
    Column("channel", Shared.CHANNEL, "", lambda row: row.block.channel, where=EVERYWHERE, kind=TEXT),
    Column("first_sun_pulse", Shared.FIRST_SUN_PULSE, "", lambda row: row.block.first, where=EVERYWHERE, kind=WHOLE),
    Column("first_utc", "first pulse", "UTC", lambda row: row.body.utc(row.pulses[0].loaded[0]), where="csv page",
           kind=TEXT),
    Column("delay_s", Shared.DELAY, "s", lambda row: row.block.delay, _six, EVERYWHERE),
    Column("delay_counts", Shared.DELAY, "counts", _counts("delay"), where=EVERYWHERE, kind=WHOLE),
    Column("delay_deg", Shared.DELAY, "deg", lambda row: _nine(math.degrees(row.block.delay * abs(row.body.spin))),
           lambda angle: f"{angle:.2f}", EVERYWHERE),
    Column("width_s", "width", "s", lambda row: row.block.width, _six, EVERYWHERE),
    Column("width_counts", "width", "counts", _counts("width"), where=EVERYWHERE, kind=WHOLE),
    Column("count", Shared.PULSES, "", lambda row: row.block.count, where=EVERYWHERE, kind=WHOLE),
    Column("every", Shared.EVERY, "turn", lambda row: row.block.every, where=EVERYWHERE, kind=WHOLE),
    Column("impulse_Nms", Shared.IMPULSE, "N m s",
           lambda row: _nine(math.fsum(pulse.magnitude for pulse in row.pulses)), _six, "csv page"),
    Column("nutation_after_deg", Shared.NUTATION_AFTER, "deg", angle_of("nutation"), small_angle, "csv page"),
)  # fmt: skip


def block_table(flown: Flight) -> DataTable:
    """The blocks of a flown schedule as they are loaded: times in s and in counts of the steps of the commands."""
    _, after = flown.around_pulses()
    pulses, body, rows = flown.schedule.pulses, flown.spacecraft, []
    lasts = accumulate(block.count for block in flown.schedule.blocks)
    for index, (block, last) in enumerate(zip(flown.schedule.blocks, lasts, strict=True)):
        rows.append(BlockRow(index, block, body, pulses[last - block.count : last], float(after.nutation[last - 1])))
    return DataTable("Command blocks", BLOCKS, rows, flown.schedule)


EVENLY = 8
"""Largest number of pulses of a block on a screen: the first, the last, and evenly some between."""


def shown_rows(table: DataTable, blocks: tuple[Block, ...]) -> DataTable:
    """The pulses that a screen shows: all, but of long blocks only some."""
    if not blocks:
        return table
    shown: list[int] = []
    for last, block in zip(accumulate(block.count for block in blocks), blocks, strict=True):
        step = max(math.ceil((block.count - 1) / (EVENLY - 1)), 1)
        shown += sorted({*range(last - block.count, last, step), last - 1})
    rows = [table.rows[index] for index in shown if index < len(table.rows)]  # a track may end before the last one
    return replace(table, rows=rows)


RESIDUAL = ("nutation", "body_cone", "space_cone", "momentum_shift", "axis_error")
"""Angles of a `Residual`."""


def heading(spacecraft: Spacecraft) -> dict[str, Any]:
    """Head of the JSON of every command: the version, and the spacecraft."""
    return {"nutdamp": __version__, "spacecraft": spacecraft_json(spacecraft)}


def infeasible_json(spacecraft: Spacecraft, why: str) -> dict[str, Any]:
    """The JSON of any command where nothing requested is feasible."""
    return {**heading(spacecraft), "feasible": False, "why": why}


def comparison_json(compared: Comparison) -> dict[str, Any]:
    """The object of ``plan --json``: the plans, the decision on one of them, and the words of both."""
    return decided_json(compared, decide(compared))


def decided_json(compared: Comparison, decided: Decision | None) -> dict[str, Any]:
    """`comparison_json` with a decision that is known already."""
    beside = () if decided is None else decision_notes(decided)
    return {
        **heading(compared.spacecraft),
        "plans": [compared_json(compared, plan) for plan in compared.plans],
        "recommended": None if compared.recommended is None else compared.recommended.scheme,
        "no_pulse_needed": compared.needless,
        "reason": joined(reasons(compared)),
        "notes": [note_json(note) for note in (*comparison_warnings(compared), *beside, *alternatives(compared))],
        "decision": None if decided is None else decision_json(decided),
    }


def compared_json(compared: Comparison, plan: Plan) -> dict[str, Any]:
    """One of the plans compared; ``cases``: the share of dispersed cases that comply, null where not all have flown."""
    data, share, cases = plan_json(plan), compared.shares.get(plan), compared.cases(plan)
    data["meets_requirement"] = compared.meets(plan)
    if plan.spacecraft.commands is not None:
        data["can_be_commanded"] = plan.commandable if plan.feasible else None
    if compared.shares:
        data["cases"] = share and {
            "samples": 0 if cases is None else cases.samples,
            "met_fraction": share.exact,
            "low": share.low,
            "high": share.high,
            "probability": share.probability,
            "met": share.met,
        }
    return data


def spacecraft_json(spacecraft: Spacecraft) -> dict[str, Any]:
    """Derived quantities of a spacecraft at t = 0."""
    inertia = spacecraft.inertia
    motion = spacecraft.widest
    return {
        "name": spacecraft.name,
        "A_kgm2": inertia.A,
        "C_kgm2": inertia.C,
        "a": inertia.a,
        "shape": inertia.shape,
        "moments_kgm2": list(inertia.moments),
        "wheel_momentum_Nms": inertia.wheel,
        "principal_axes": cleaned(inertia.axes.T).tolist(),
        "omega0_rad_s": inertia.in_file(spacecraft.omega0).tolist(),
        "nutation_deg": math.degrees(motion.nutation),
        "body_cone_deg": math.degrees(motion.body),
        "space_cone_deg": math.degrees(motion.space),
        "nutation_at_start_deg": math.degrees(spacecraft.tilt),
        "body_nutation_period_s": spacecraft.body_period,
        "inertial_nutation_period_s": spacecraft.inertial_period,
        "target_axis": cleaned(spacecraft.target_axis).tolist(),
        "target_angle_deg": math.degrees(spacecraft.to_turn),
        "target_spin_rad_s": spacecraft.goal.spin,
    }


def plan_json(plan: Plan) -> dict[str, Any]:
    """One plan; an infeasible one has no pulses, nulls, and the reason."""
    schedule, body = plan.schedule, plan.spacecraft
    return {
        "scheme": plan.scheme,
        "feasible": plan.feasible,
        "why": infeasibility(plan) or None,
        "meets_requirement": plan.meets_requirement,
        "requirement": requirement_json(plan),
        "pulses": commanded(plan.pulses, body).json(),
        "total_impulse_Nms": None if schedule is None else schedule.total_impulse,
        "least_impulse_Nms": None if schedule is None else body.least_impulse,
        "propellant_kg": None if schedule is None else schedule.propellant,
        "end_s": None if schedule is None else schedule.end,
        "delta_v_m_s": None if plan.delta_v is None else cleaned(plan.delta_v).tolist(),
        "spin_change_rad_s": plan.spin_change,
        "residual": residual_json(plan.residual),
        "flown": residual_json(plan.flown),
        "final": None if schedule is None else final_json(plan.flight),
        "target": target_json(body),
        **aspects_json(plan.aspects if plan.feasible else ()),
        "bounds": None if plan.pulses.bounds is None else plan.pulses.bounds._asdict(),
        "notes": [note_json(note) for note in plan_notes(plan)] if plan.feasible else [],
    }


def requirement_json(plan: Plan) -> list[dict[str, Any]] | None:
    """The requirement and the residuals, part by part; None where nothing is required, or without a schedule."""
    parts = []
    for part in plan.held:
        if part.bound.required:
            unit, scale = _unit(part.bound)
            left, most = scale * part.left, scale * part.bound.most
            parts.append({"part": part.bound.part.value, f"left_{unit}": left, f"most_{unit}": most, "met": part.met})
    return parts or None


def _unit(bound: Bound) -> tuple[str, float]:
    """Unit of a part in files, and its factor from SI."""
    return ("rad_s", 1.0) if bound.part is Part.SPIN else ("deg", 180.0 / math.pi)


def final_json(flown: Flight) -> dict[str, Any]:
    """Final spin axis and angular momentum, and the motion from then on."""
    body, final, settled = flown.spacecraft, flown.final, flown.settled
    rates, quaternion = body.inertia.in_file_axes(settled.rates, settled.quaternion)
    return {
        "axis": direction_json(body, final.axis),
        "momentum": direction_json(body, final.momentum),
        "spin_rad_s": final.spin,
        "nutation_deg": math.degrees(final.nutation),
        "omega_rad_s": rates.tolist(),
        "quaternion": quaternion.tolist(),
    }


def target_json(body: Spacecraft) -> dict[str, Any] | None:
    """The requirement on the end, in the form of `final_json`; None where nothing is required."""
    axis, spin = body.goal.axis, body.goal.spin
    if axis is None and spin is None:
        return None
    return {"axis": None if axis is None else direction_json(body, axis), "spin_rad_s": spin}


def aspects_json(aspects: tuple[Aspect, ...]) -> dict[str, Any]:
    """Range of angles of the spin axis from each direction that is watched; nothing for a file that names none."""
    entries = [
        {
            "name": aspect.keep.name,
            "least_deg": math.degrees(aspect.least),
            "least_s": aspect.least_at,
            "largest_deg": math.degrees(aspect.largest),
            "largest_s": aspect.largest_at,
            "min_deg": math.degrees(aspect.keep.least),
            "max_deg": math.degrees(aspect.keep.most),
            "kept": aspect.kept,
        }
        for aspect in aspects
    ]
    return {"aspects": entries} if entries else {}


def direction_json(body: Spacecraft, direction: Vector) -> dict[str, float | None]:
    """The two angles that name an inertial direction (3,), as `Spacecraft.angles_of`."""
    around, other = (None if angle is None else math.degrees(angle) for angle in body.angles_of(direction))
    if body.attitude is None:
        return {"tilt_deg": other, "azimuth_deg": around}
    return {"right_ascension_deg": around, "declination_deg": other}


def residual_json(residual: Residual | None) -> dict[str, float | None]:
    """Cone angles and shifts in degrees; nulls where there is no schedule."""
    return {f"{name}_deg": None if residual is None else math.degrees(getattr(residual, name)) for name in RESIDUAL}


def decision_json(decision: Decision) -> dict[str, Any]:
    """The plan, whether it ``met`` the requirement and the verdict in words, part by part with margins, its end.

    ``cases`` is null where none were flown.
    """
    plan, cases, pulses = decision.plan, decision.cases, decision.flight.schedule
    return {
        "scheme": plan.scheme,
        "met": decision.met,
        "verdict": verdict(decision),
        "requirement": [_line_json(line) for line in decision.lines],
        "cases": None
        if cases is None
        else {
            "samples": cases.samples,
            "seed": cases.seed,
            "met_fraction": cases.complying,
            "probability": cases.probability,
            "met": cases.met,
        },
        "final": final_json(decision.flight),
        **aspects_json(decision.aspects),
        "propellant_kg": pulses.propellant,
        "total_impulse_Nms": pulses.total_impulse,
        "end_s": pulses.end,
    }


def _line_json(line: Line) -> dict[str, Any]:
    """A part: its limit, its residual with nominal values and in the share of cases required, and the margin."""
    unit, scale = _unit(line.bound)
    return {
        "part": line.bound.part.value,
        "required": line.bound.required,
        f"limit_{unit}": scale * line.bound.most,
        f"nominal_{unit}": scale * line.nominal,
        f"dispersed_{unit}": None if line.dispersed is None else scale * line.dispersed,
        f"margin_{unit}": scale * line.margin,
        "met": line.met,
    }


PROVES = (
    "no firing of these channels within the windows that reaches the goal by the equations costs less than bound = "
    "sum of price times goal - off times |prices of shift| - gained: q is at most 1 at every moment for channels that "
    "act at once, and for the others gained is at least the integral of cost_per_s times (q - 1) where q is above 1"
)


MODEL = (
    "small angles, symmetric body, spin as at t = 0: exact for the nutation as long as nothing changes the spin, of "
    "first order for the direction of H; impulses of any size at once for channels with acts_at_once, at most the full "
    "torque at a time for the others"
)


NOT_COUNTED = (
    "gaps, ticks, least and longest on-times, max_pulses, that channels may not be on together, valves, cold nozzles "
    "and falling pressure: each can only raise the cost of the same equations"
)


def certificate_json(certificate: Certificate) -> dict[str, Any]:
    """The file of ``plan --certificate``: all data to check a least cost by hand, in SI.

    It is about the transverse impulse of a symmetric body of small angles. With E1 = e^{i α t} min(1, e^{-κ (t -
    t_last)}) and E2 = e^{i ω t}, where α is ``nutation_rad_s``, ω is ``spin_rad_s`` and κ is ``growth_per_s``, a second
    of a channel of the torque (m1, m2, m3) at t adds E1 (m1 + i m2) to the equations nutation, E2 (m1 + i m2) to the
    equations shift, and m3 to the equation spin. Of each equation the file has the goal and the price y, and q(t) of a
    channel is the sum of y times what it adds, over ``cost_per_s``.
    """
    body, program, proof = certificate.spacecraft, certificate.program, certificate.proof
    equations = zip(certificate.rows, program.influence.goal.tolist(), proof.prices.tolist(), strict=True)
    names, pulses = [channel.name for channel in program.channels], certificate.plan.pulses
    return {
        "nutdamp": __version__,
        "certificate": 1,
        "spacecraft": body.name,
        "proves": PROVES,
        "model": MODEL,
        "not_counted": NOT_COUNTED,
        "a": body.inertia.a,
        "spin_rad_s": body.spin,
        "nutation_rad_s": body.nutation_rate,
        "growth_per_s": body.growth,
        "last_s": certificate.last,
        "windows_s": [list(span) for span in certificate.windows],
        "unit": certificate.problem.unit,
        "equations": [{"name": name, "goal_Nms": goal + 0.0, "price": price + 0.0} for name, goal, price in equations],
        "off_Nms": program.off,
        "channels": [
            {
                "name": channel.name,
                "torque_Nm": channel.torque.tolist(),
                "cost_per_s": float(cost),
                "acts_at_once": bool(strong),
            }
            for channel, cost, strong in zip(program.channels, program.costs, program.strong, strict=True)
        ],
        "gained": proof.gained,
        "bound": proof.bound,
        "burns": [_burn(certificate, burn) for burn in certificate.burns],
        "burns_cost": certificate.cost,
        "plan": {
            "cost": pulses.cost_in(certificate.problem.unit),
            "pulses": [{"channel": pulse.channel, "t_s": pulse.t, "on_time_s": pulse.on_time} for pulse in pulses],
        },
        "primer": [
            {"t_s": times.tolist(), "q": dict(zip(names, certificate.primer(times).T.tolist(), strict=True))}
            for times in certificate.moments()
        ],
    }


def _burn(certificate: Certificate, burn: Burn) -> dict[str, Any]:
    at = certificate.program.channels.index(burn.channel)
    q = certificate.primer(np.array([burn.t]))[0, at]
    return {"channel": burn.channel.name, "t_s": burn.t, "on_time_s": burn.on_time, "q": float(q)}

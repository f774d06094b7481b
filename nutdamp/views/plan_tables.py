"""The screen of ``plan``: the spacecraft, the schemes compared, the recommendation, its pulses."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.flight.end_state import at_start
from nutdamp.flight.propagation import REAL_WIDTHS, Residual, model_name
from nutdamp.planning.decision import Comparison, decide, notes_on
from nutdamp.planning.plan import NO_NUTATION, Plan
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import SLACK, Spacecraft
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.spacecraft.schedule import STEERABLE, Pulse
from nutdamp.views import verdicts
from nutdamp.views.block_tables import blocks_screen
from nutdamp.views.decisions import COUNT, decision_screen, limit, size
from nutdamp.views.end_tables import add_aspects, angle_names, angle_texts, cone_margins, direction_text, spin_text
from nutdamp.views.layout import columns, facts
from nutdamp.views.text import MISSING, degrees, digits, duration, in_degrees, mass, moment, quantity, steering


def comparison_screen(compared: Comparison) -> RenderableType:
    """All tables of ``plan``, the decision on top."""
    decided, name = decide(compared), Text(compared.spacecraft.name, style="bold")
    results: list[RenderableType] = [Text(), derived_table(compared.spacecraft), Text(), _comparison(compared)]
    results += _reasons(compared)
    needless = verdicts.needless(compared)
    parts = [name] if needless is None else [name, Text.assemble(("No pulse needed: ", "bold"), f"{needless}.")]
    if decided is None:
        parts.append(Text(f"No recommendation: {verdicts.reason(compared)}.", style="bold"))
        return Group(*parts, *results)
    if decided.plan.pulses.blocks:
        results += [Text(), blocks_screen(decided.plan.flight, decided.plan.delta_v)]
    elif len(decided.plan.pulses):
        results += [Text(), pulse_table(decided.plan)]
    return Group(*parts, *decision_screen(compared, decided, verdicts.reason(compared)), *results)


def header(spacecraft: Spacecraft, more: Iterable[tuple[str, str]] = ()) -> RenderableType:
    """Name and derived quantities of the spacecraft at t = 0, and ``more`` of them (name, value)."""
    return Group(Text(spacecraft.name, style="bold"), derived_table(spacecraft, more))


def derived_table(spacecraft: Spacecraft, more: Iterable[tuple[str, str]] = ()) -> Table:
    """Derived quantities of the spacecraft at t = 0, and ``more`` of them (name, value)."""
    inertia = spacecraft.inertia
    motion = spacecraft.widest
    table = facts()
    moments = f"A = {quantity(inertia.A, 'kg m²', 6)}, C = {quantity(inertia.C, 'kg m²', 6)}"
    table.add_row("inertia", f"{moments}: {inertia.shape}, a = {inertia.a:.4g}")
    if not inertia.symmetric:
        first, second, _ = inertia.moments
        table.add_row("", f"I1 = {first:.6g}, I2 = {second:.6g} kg m²; planned on the equivalent symmetric body")
    table.add_row("spin", spin_text(spacecraft.spin) + ": the spin axis is body axis -3" * (spacecraft.spin < 0.0))
    now = "" if inertia.symmetric else f"{degrees(spacecraft.tilt)} at t = 0, at most "
    cones = f"body cone {degrees(motion.body)} + space cone {degrees(motion.space)}"
    table.add_row("nutation", f"{now}{degrees(motion.nutation)} = {cones}")
    still = math.isinf(spacecraft.body_period)
    in_body = "none in the body, where ω does not turn" if still else f"{duration(spacecraft.body_period)} in the body"
    table.add_row("nutation period", f"{in_body}, {duration(spacecraft.inertial_period)} inertially")
    if spacecraft.dissipation is not None:
        table.add_row("dissipation", dissipation_text(spacecraft, spacecraft.dissipation))
    beyond = beyond_floors(spacecraft)
    floor = f"no least impulse with {beyond}" if beyond else "removing all nutation takes no less"
    name = "impulse" if beyond else "least impulse"
    table.add_row(name, f"A|ω0| = {quantity(spacecraft.least_impulse, 'N m s')}; {floor}")
    if spacecraft.goal.axis is not None:
        turn = quantity(_turning(spacecraft), "N m s")
        least = "" if beyond else ", the least to turn H"
        table.add_row("target", direction_text(spacecraft, spacecraft.goal.axis))
        table.add_row("", f"β = {degrees(spacecraft.to_turn)} from H; C|ω3|β = {turn}{least}")
    if spacecraft.goal.spin is not None:
        table.add_row("final spin", spin_text(spacecraft.goal.spin))
    table.add_row("actuators", _actuators(spacecraft))
    for line, text in enumerate(_requirement(spacecraft)):
        table.add_row("" if line else "requirement", text)
    add_aspects(table, at_start(spacecraft))
    for name, value in more:
        table.add_row(name, value)
    return table


def _requirement(spacecraft: Spacecraft) -> Iterator[str]:
    """The requirement, and the differences from the key of the file."""
    bounds = requirements.required(spacecraft)
    if bounds:
        yield verdicts.required(spacecraft)
    if any(bound.part is Part.DISTANCE for bound in bounds):
        yield "momentum_shift bounds the error of H: its angle from the target"


def dissipation_text(spacecraft: Spacecraft, time_constant: float) -> str:
    """Effect of energy dissipation on the nutation, and a note where it is too fast for its model."""
    if spacecraft.growth == 0.0:
        return "none: a sphere has no energy to lose"
    what = "grows" if spacecraft.growth > 0.0 else "decays"
    slow = time_constant >= spacecraft.inertial_period
    rough = "" if slow else "; less than one inertial period: results are rough"
    return f"the nutation {what} e-fold in {duration(time_constant)}{rough}"


def beyond_floors(spacecraft: Spacecraft) -> str:
    """Actions that break the floors A|ω0| and C|ω3|β, in words; empty where they hold."""
    causes = [
        *["I1 ≠ I2"] * (not spacecraft.inertia.symmetric),
        *["dissipation"] * (spacecraft.growth != 0.0),
        *["disturbances"] * bool(spacecraft.disturbances),
    ]
    return " and ".join(causes)


def _turning(spacecraft: Spacecraft) -> float:
    """C |ω3| β in N m s; 0 where H points at the target already, but for rounding."""
    return 0.0 if spacecraft.to_turn < NO_NUTATION else spacecraft.turning_impulse


def _actuators(spacecraft: Spacecraft) -> str:
    torquer = spacecraft.torquer
    texts = []
    if torquer is not None:
        strength = "an ideal impulse" if torquer.torque is None else quantity(torquer.torque, "N m")
        assumed = " (assumed: the file names no actuator)" if spacecraft.steerable is None else ""
        texts.append(f"steerable torquer, {strength}{assumed}")
    if spacecraft.channels:
        texts.append("channels " + " ".join(channel.name for channel in spacecraft.channels))
    return "; ".join(texts)


MILLISECONDS = 3
"""Digits of a second that a table of pulses shows of a date."""

Cell = Callable[[Plan], str]

NOT = "✗"
"""Sign before a value above the requirement."""

UNIT = re.compile(r"\d (\D+)$")
"""Pattern of the unit behind the last digit of a cell and a space."""

SHORT_NAMES = ("RA", "dec")
"""Right ascension and declination, where there is little room."""


def _rows(compared: Comparison) -> list[tuple[str, Cell]]:
    """Rows of the comparison, with the values of each feasible plan."""
    (least, ratio), *others = ratios(compared.spacecraft)
    rows: list[tuple[str, Cell]] = [
        ("pulses", lambda plan: str(len(plan.pulses))),
        ("ends at", lambda plan: moment(plan.pulses.end)),
        ("impulse", lambda plan: quantity(plan.pulses.total_impulse, "N m s")),
        (f"  {least}" if beyond_floors(compared.spacecraft) else "  × least impulse", ratio),
        *((f"  {name}", cell) for name, cell in others),
        ("propellant", lambda plan: mass(plan.pulses.propellant)),
        ("by impulses (17):", lambda _: ""),
        ("  nutation left", lambda plan: _angle(plan.residual, "nutation")),
        ("  shift of H", lambda plan: _angle(plan.residual, "momentum_shift")),
        ("flown, real widths:", lambda _: ""),
        ("  nutation left", lambda plan: _angle(plan.flown, "nutation")),
        ("  body cone", lambda plan: _angle(plan.flown, "body_cone")),
        ("  space cone", lambda plan: _angle(plan.flown, "space_cone")),
        ("  shift of H", lambda plan: _angle(plan.flown, "momentum_shift")),
        ("  spin change", lambda plan: quantity(plan.spin_change, "rad/s")),
    ]
    first, second = SHORT_NAMES if compared.spacecraft.attitude is not None else angle_names(compared.spacecraft)
    rows[-1:-1] = [
        (f"  axis: {first}", lambda plan: angle_texts(plan.spacecraft, plan.flight.final.axis)[0]),
        (f"  axis: {second}", lambda plan: angle_texts(plan.spacecraft, plan.flight.final.axis)[1]),
    ]
    goal = compared.spacecraft.goal
    if goal.axis is not None:
        rows.insert(-1, ("  off the target", lambda plan: _angle(plan.flown, "axis_error")))
    if goal.spin is not None:
        rows.append(("  spin at the end", lambda plan: quantity(plan.flight.settled.spin, "rad/s", 6)))
    if any(plan.delta_v is not None for plan in compared.plans):
        rows.append(
            ("  |ΔV|", lambda plan: MISSING if plan.delta_v is None else quantity(math.hypot(*plan.delta_v), "m/s"))
        )
    if compared.spacecraft.commands is not None:
        rows.append(("command blocks", lambda plan: "yes" if plan.commandable else "cannot be\ncommanded"))
    if requirements.judged(compared.spacecraft):
        rows.append(("requirement:", lambda plan: verdicts.VERDICT[compared.meets(plan)]))
        if compared.shares:
            rows.append((f"  {COUNT}", lambda plan: verdicts.share_text(compared.shares.get(plan))))
        rows += [_part(bound) for bound in requirements.required(compared.spacecraft)]
        cones = enumerate(at_start(compared.spacecraft)[: len(compared.spacecraft.keep)])
        rows += [_cone(at, cone.keep.name, kept) for at, cone in cones for kept, _, _ in cone_margins(cone)]
    return rows


def ratios(body: Spacecraft) -> Iterator[tuple[str, Cell]]:
    """The impulse of a plan over A|ω0|, and with a target over C|ω3|β."""

    def ratio(whole: float) -> Cell:
        return lambda plan: f"{plan.pulses.total_impulse / whole:.4f}" if whole > 0.0 else MISSING

    yield "× A|ω0|", ratio(body.least_impulse)
    if body.goal.axis is not None:
        yield "× C|ω3|β", ratio(_turning(body))


def _part(bound: Bound) -> tuple[str, Cell]:
    """The row of one part of the requirement: its bound, and the residuals of the plans."""

    def cell(plan: Plan) -> str:
        (part,) = (part for part in plan.held if part.bound == bound)
        return size(bound, part.left) if part.met else f"{NOT} {size(bound, part.left)}"

    return f"  {bound.part.label} {limit(bound)}", cell


def _cone(at: int, name: str, kept: str) -> tuple[str, Cell]:
    """The row of one bound of the cone with the number ``at``, and the angle at which the plans come nearest to it."""

    def cell(plan: Plan) -> str:
        angles = ((angle, left) for bound, angle, left in cone_margins(plan.aspects[at]) if bound == kept)
        return next(degrees(angle) if left >= -SLACK else f"{NOT} {degrees(angle)}" for angle, left in angles)

    return f"  from {name} {kept}", lambda plan: cell(plan) if plan.feasible else MISSING


def _angle(left: Residual | None, name: str) -> str:
    return MISSING if left is None else degrees(getattr(left, name))


def _comparison(compared: Comparison) -> Table:
    """Quantities and their units down, schemes across: so four schemes fit a screen of 80 columns."""
    table = columns("", *(plan.scheme for plan in compared.plans))
    rows = _rows(compared) if any(plan.feasible for plan in compared.plans) else _rows(compared)[:1]
    for name, cell in rows:
        cells = [cell(plan) if plan.feasible else "" for plan in compared.plans]
        if name == "pulses":
            cells = [text or verdicts.no_plan(plan) for text, plan in zip(cells, compared.plans, strict=True)]
        name, cells = _unit_first(name, cells)
        table.add_row(Text(name, style="dim"), *cells)
    return table


def _unit_first(name: str, cells: list[str]) -> tuple[str, list[str]]:
    """The name of a row with the unit that all its numbers share, and these without it; else both as they are."""
    units = {match.group(1) for match in map(UNIT.search, cells) if match}
    if len(units) != 1:
        return name, cells
    (unit,) = units
    return name if name.endswith(f" {unit}") else f"{name}, {unit}", [text.removesuffix(f" {unit}") for text in cells]


def _reasons(compared: Comparison) -> list[RenderableType]:
    """Reasons why schemes are infeasible, and the remarks of the others; those that several share stand once."""
    schemes_of: dict[str, list[str]] = {}
    for plan in compared.plans:
        for remark in notes_on(plan):
            schemes_of.setdefault(remark, []).append(plan.scheme)
    lines = [Text.assemble((f"{', '.join(schemes)}: ", "bold"), remark) for remark, schemes in schemes_of.items()]
    return [Text(), *lines] if lines else []


def pulse_table(plan: Plan) -> Table:
    """One row a pulse: time, duration, channel, and the nutation before and after.

    With an epoch the start in UTC takes the room of the centre. Through valves start and on-time are those of the
    command, and the effective on-time is shown beside it.
    """
    before, after = plan.flight.around_pulses()
    pulses, body = plan.pulses, plan.spacecraft
    loaded = [pulse.loaded for pulse in pulses]
    day, clocks = _clocks([body.utc(start, MILLISECONDS) for start, _ in loaded])
    second = (f"UTC\n{day}", clocks) if clocks else ("centre\ns", [f"{pulse.t:.4f}" for pulse in pulses])
    cells: list[tuple[str, list[str]]] = [
        ("pulse\n", [str(index + 1) for index in range(len(pulses))]),
        ("start\ns", [f"{start:.4f}" for start, _ in loaded]),
        second,
        ("on-time\ns", ["ideal" if on_time == 0.0 else f"{on_time:.4f}" for _, on_time in loaded]),
        *([("effective\ns", [f"{pulse.on_time:.4f}" for pulse in pulses])] if pulses.through_valves else []),
        ("channel\n", [channel_text(pulse, body) for pulse in pulses]),
        ("impulse\nN m s", [digits(pulse.magnitude, 4) for pulse in pulses]),
        ("nutation\ndeg", [in_degrees(angle) for angle in before.nutation.tolist()]),
        ("after\ndeg", [in_degrees(angle) for angle in after.nutation.tolist()]),
    ]
    table = columns(*(name for name, _ in cells), text=("channel\n",))
    for row in zip(*(column for _, column in cells), strict=True):
        table.add_row(*row)
    return table


def _clocks(dates: list[str | None]) -> tuple[str, list[str]]:
    """The day that all dates share, and of each the rest; nothing where one is not known."""
    known = [date.removesuffix("Z").split("T") for date in dates if date is not None]
    if not known or len(known) < len(dates):
        return "", []
    clocks = [time for _, time in known]
    if len({day for day, _ in known}) == 1:
        return known[0][0], clocks
    return "", [f"{day} {clock}" for (day, _), clock in zip(known, clocks, strict=True)]


def flown_by(compared: Comparison) -> str:
    """Model by which schemes are flown beside each other, with those that alone fire ideal impulses."""
    how = model_name(plan.pulses for plan in compared.plans)
    ideal = [plan.scheme for plan in compared.plans if plan.pulses.idealised]
    return how if how != REAL_WIDTHS or not ideal else f"{how} (ideal impulses: {listed(ideal)})"


def channel_text(pulse: Pulse, body: Spacecraft) -> str:
    """The channel of a pulse; a steerable one is named by the angle of its torque too."""
    if pulse.channel != STEERABLE:
        return pulse.channel
    return f"{STEERABLE} {steering(body.inertia.in_file(pulse.impulse).tolist())}"

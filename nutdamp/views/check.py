"""The check of a file: derived quantities, channels, valves, disturbances, tolerances; the pair for
two pulses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import RenderableType

from nutdamp import __version__
from nutdamp.common.numerics import finite
from nutdamp.common.results import Data, Note, note
from nutdamp.control_loop.stability import margins
from nutdamp.errors import CannotRead, Fault, FaultyFile, NutdampError, listed
from nutdamp.files.reader import Source
from nutdamp.flight.cones import at_start
from nutdamp.montecarlo.inputs import reachable
from nutdamp.physics.thruster import Tank
from nutdamp.planning import capability
from nutdamp.planning.capability import Acting, ChannelSteps, Consequence
from nutdamp.planning.notes import shift_notes, spacecraft_notes
from nutdamp.spacecraft.equipment import ANGLE
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.decisions import (
    aspects_json,
    derived_facts,
    direction_json,
    spacecraft_json,
)
from nutdamp.views.dispersion import correlation_json, in_words, size_text, unused_notes
from nutdamp.views.loop import described, margin_table, warnings
from nutdamp.views.parts import Summary, named
from nutdamp.views.tables import (
    TEXT,
    Column,
    DataTable,
    Shared,
    facts,
    file_columns,
    to_figures,
    values_of,
)
from nutdamp.views.text import (
    degrees,
    duration,
    moment,
    note_json,
    ordered,
    quantity,
    small_angle,
    vector,
)


def channel_table(spacecraft: Spacecraft) -> DataTable:
    """Torque and on-times of each channel, and the nutation that its shortest and longest pulse
    take.
    """

    def on_times(row: ChannelSteps) -> str:
        longest = row.channel.max_on_time
        until = "any" if math.isinf(longest) else duration(longest)
        return f"{duration(row.channel.min_on_time)} to {until}"

    columns = (
        Column.named("name=channel.name", Shared.CHANNEL, "", where="screen json", kind=TEXT),
        Column(
            "torque#_Nm",
            "torque, file axes",
            "N m",
            lambda row: spacecraft.inertia.in_file(row.channel.torque),
            vector,
            "screen json",
            kind=TEXT,
        ),
        Column("", Shared.ON_TIME, "", on_times, where="screen", rank=2),
        *file_columns(
            "json", "min_on_time_s=channel.min_on_time", "max_on_time_s=channel.max_on_time"
        ),
        Column.named(
            "smallest_step_deg=smallest",
            "smallest step",
            "deg",
            lambda step: small_angle(step) if step else "any",
            "screen json",
        ),
        Column.named(
            "largest_step_deg=largest", "largest step", "deg", small_angle, "screen json", rank=1
        ),
        *file_columns("json", "damps=channel.damps"),
    )
    return DataTable("Channels", columns, capability.channel_steps(spacecraft))


def channel_facts(spacecraft: Spacecraft, name: str) -> list[tuple[str, str]]:
    """Thrusters, arm, torque, on-times and steps of the channel of a ``name``; none without it."""
    table = channel_table(spacecraft)
    columns = table.at("screen")[1:]
    for row in table.rows:
        channel = row.channel
        if channel.name == name:
            force = 0.0 if channel.force is None else math.hypot(*channel.force)
            times = (channel.min_on_time, channel.max_on_time)
            impulses = [f"{channel.strength * time:.4g}" for time in times if math.isfinite(time)]
            return [
                ("thrusters", ", ".join(thruster.name for thruster in channel.thrusters)),
                ("arm", f"{channel.strength / force:.4g} m" if force else "not known"),
                ("impulse, N m s", " to ".join([*impulses, "any"][:2])),
                *((column.headed(", "), column.shown(row)) for column in columns),
            ]
    return []


VALVES = (  # columns of pulses of valves that are alike
    Column(
        "",
        Shared.CHANNEL,
        "",
        lambda alike: ", ".join(pulse.channel.name for pulse in alike),
        where="screen",
        kind=TEXT,
    ),
    Column(
        "on_time_s",
        "on-time commanded",
        "",
        lambda alike: alike[0].on_time,
        duration,
        "screen json",
    ),
    Column(
        "effective_on_time_s",
        Shared.EFFECTIVE,
        "",
        lambda alike: alike[0].effective,
        duration,
        "screen json",
    ),
    Column(
        "impulse_Nms",
        Shared.IMPULSE,
        "N m s",
        lambda alike: alike[0].impulse,
        to_figures(4),
        "screen json",
    ),
    Column(
        "centroid_s",
        "centroid after the start",
        "",
        lambda alike: alike[0].centroid,
        duration,
        "screen json",
    ),
)


def valve_table(spacecraft: Spacecraft) -> DataTable:
    """Pulses of the shortest and the longest command of each channel; channels that do alike share
    a row.
    """
    alike: dict[tuple[float, ...], list[Acting]] = {}
    for pulse in capability.acting(spacecraft):
        figures = (float(f"{figure:.4g}") for figure in pulse[1:])
        alike.setdefault(tuple(figures), []).append(pulse)
    return DataTable("Valves", VALVES, list(alike.values()))


TURNS = (
    Column.named("name=channel.name", "command blocks", "", where="screen json", kind=TEXT),
    Column.named(
        "smallest_turn_deg=smallest", "least turn of H", "deg", small_angle, "screen json"
    ),
    Column.named(
        "smallest_turn_width_s=smallest_width", "by a pulse of", "", duration, "screen json"
    ),
    Column.named("largest_turn_deg=largest", "largest turn", "deg", small_angle, "screen json"),
    Column.named(
        "largest_turn_width_s=largest_width", "by a pulse of", "", duration, "screen json"
    ),
)


def turn_table(spacecraft: Spacecraft) -> DataTable:
    """Turn of H by one pulse of a command block of each channel."""
    return DataTable("Command blocks", TURNS, capability.turns(spacecraft))


TANK = (
    Column("used_kg", "used", "kg", lambda row: row[1], to_figures(4), "screen json"),
    Column("pressure_Pa", "pressure", "", lambda row: row[0].pressure_after(row[1]),
           lambda pressure: quantity(1e-5 * pressure, "bar"), "screen json"),
    Column("thrust_factor", "thrust", "%", lambda row: row[0].thrust_factor(row[1]),
           to_figures(4, 100.0), "screen json"),
    Column("isp_s", "isp", "s", lambda row: row[0].isp_after(row[1]), to_figures(4), "screen json"),
)  # fmt: skip


def tank_table(tank: Tank) -> DataTable:
    """Pressure, thrust and specific impulse of a tank full, half used and empty."""
    return DataTable("Tank", TANK, [(tank, share * tank.propellant) for share in (0.0, 0.5, 1.0)])


def disturbance_table(spacecraft: Spacecraft) -> DataTable:
    """The forced tilt, the beat, or the times to reach a cone at resonance."""
    rows = list(capability.consequences(spacecraft))
    numbers = {id(row): number for number, row in enumerate(rows, start=1)}

    def reached(row: Consequence) -> list[dict[str, float]]:
        return [{"nutation_deg": math.degrees(mark), "t_s": time} for mark, time in row.resonant]

    columns = (
        Column(
            "name",
            "disturbance",
            "",
            lambda row: row.disturbance.name or None,
            where="screen json",
            kind=TEXT,
            words=lambda row: row.disturbance.name or f"number {numbers[id(row)]}",
        ),
        *file_columns("json", "from_s=disturbance.begin", "until_s=disturbance.end"),
        Column("", "effect", "", lambda row: "; ".join(_effects(row)), where="screen", kind=TEXT),
        *file_columns(
            "json",
            "forced_rate_rad_s=forced",
            "precession_rad_s",
            "momentum_swing_deg=swing",
            "forced_tilt_deg=tilt",
            "beat_deg",
            "beat_period_s",
        ),
        Column("reaches", "", "", reached, where="json"),
        *file_columns("json", "spin_rate_rad_s2=spin_rate"),
    )
    return DataTable("Disturbances", columns, rows)


def _effects(row: Consequence) -> Iterator[str]:
    begin, end = row.disturbance.begin, row.disturbance.end
    if begin > 0.0 or end < math.inf:
        until = f" until {duration(end)}" if end < math.inf else ""
        yield f"acts from {duration(begin)}{until}"
    if row.beat is None:
        reached = ", ".join(
            f"{degrees(mark)} after {duration(time)}" for mark, time in row.resonant
        )
        yield f"resonant with the nutation: drives it to {reached}"
    elif row.tilt is None:
        yield f"from rest drives the nutation to {degrees(row.beat)}"
    elif row.disturbance.transverse != 0.0:
        yield f"forces a tilt of {degrees(row.tilt)}, forced rate {quantity(row.forced, 'rad/s')}"
        if row.swing is None:
            yield f"precession of H at {quantity(row.precession, 'rad/s')}"
        else:
            yield f"H stays within {degrees(row.swing)}"
        yield (
            f"from rest the nutation beats up to {degrees(row.beat)} every "
            f"{duration(row.beat_period)}"
        )
    if row.spin_rate != 0.0:
        yield f"changes the spin by {row.spin_rate:.4g} rad/s²"


# columns of tolerances by their name, distribution and size, and the thrusters that they are given
# for
TOLERANCES = (
    Column("", "dispersion", "", lambda row: in_words(row[0][0]), where="screen", kind=TEXT),
    Column("", "distribution", "", lambda row: row[0][1], where="screen", kind=TEXT),
    Column("", "one sigma or bias", "", lambda row: row[0][2], where="screen"),
    Column("", Shared.THRUSTERS, "", lambda row: ", ".join(row[1]), where="screen", kind=TEXT),
)


def tolerance_table(spacecraft: Spacecraft) -> DataTable:
    """Differences allowed between true values and the file's; those of one size share a row."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for entry in () if spacecraft.dispersions is None else reachable(spacecraft)[0]:
        name = entry.name if entry.tolerance == "inertia_tensor" else entry.tolerance
        thrusters = alike.setdefault((name, entry.kind, size_text(entry)), [])
        tolerance = getattr(spacecraft.dispersions, entry.tolerance)
        rest = entry.name.partition(" ")[2]  # the thruster, and behind a blank the axis
        names = tolerance if isinstance(tolerance, Mapping) else ()
        thrusters += [name for name in names if name in (rest, rest[:-2]) and name not in thrusters]
    return DataTable("Dispersions", TOLERANCES, list(alike.items()))


def check_screen(spacecraft: Spacecraft, *, verbose: bool = True) -> RenderableType:
    """The screen of ``check`` for one valid file."""
    details, tables, notes = check_parts(spacecraft, verbose=verbose)
    tolerances = len(tolerance_table(spacecraft).rows)
    counted = f" (channels: {len(spacecraft.channels)}, tolerances: {tolerances})"
    return Summary(
        [named(spacecraft, "   ", ("VALID", "bold green"), counted), facts(details)],
        lambda first=None: [each.screen("screen", first=first) for each in tables],
        notes,
        "nutdamp plan · nutdamp report",
        verbose,
    )


def check_parts(
    spacecraft: Spacecraft, *, verbose: bool = True
) -> tuple[list[tuple[str, str]], list[DataTable], list[Note]]:
    """Names and values, tables, and notes of the screen."""
    notes = ordered([*warnings(spacecraft), *_notes(spacecraft, verbose=verbose)])
    details = [*derived_facts(spacecraft)]
    if not verbose:
        return details, [channel_table(spacecraft)] if spacecraft.channels else [], notes
    details += [*_spin_axis(spacecraft), *sun_pulse_facts(spacecraft)]
    tables = [channel_table(spacecraft), turn_table(spacecraft), valve_table(spacecraft)]
    tables += [] if spacecraft.tank is None else [tank_table(spacecraft.tank)]
    held = () if spacecraft.loop is None else margins(spacecraft, spacecraft.loop)
    tables += [disturbance_table(spacecraft), margin_table(held), tolerance_table(spacecraft)]
    return details, [table for table in tables if table.rows], notes


def _notes(spacecraft: Spacecraft, *, verbose: bool) -> Iterator[Note]:
    """Notes on a valid file; ``verbose``: disturbances stand in a table."""
    yield from shift_notes(spacecraft)
    clock = capability.sun_clock(spacecraft)
    dispersions = spacecraft.dispersions
    yield from spacecraft_notes(spacecraft)
    if spacecraft.utc(0.0) is not None and spacecraft.utc(spacecraft.horizon) is None:
        yield note("dates-end", horizon_s=spacecraft.horizon)
    if clock is not None and clock.refusal:
        yield note("no-sun-pulse", why=clock.refusal)
    yield from unused_notes(() if dispersions is None else reachable(spacecraft)[1])
    idle = [channel.name for channel in spacecraft.channels if not channel.damps]
    if idle:
        yield note("never-damping", channels=", ".join(idle))
    if not verbose:
        for name, effect in disturbance_table(spacecraft).cells("screen"):
            yield note("disturbance", disturbance=name, effect=effect)
    angle = math.degrees(capability.mounting_angle(spacecraft))
    pair = capability.nearest_pair(spacecraft)
    if pair is None:
        yield note("two-pulse-spacing", spacing_deg=angle)
    else:
        off = abs(math.degrees(pair.miss))
        yield note(
            "two-pulse-pair",
            spacing_deg=angle,
            first=pair.first.name,
            second=pair.second.name,
            off_deg=off,
        )
    if spacecraft.cold is not None:
        levels = ", ".join(f"{100.0 * spacecraft.cold.factor(before):.4g}" for before in range(3))
        yield note("cold-nozzles", levels=levels)
    if spacecraft.loop is not None:
        yield note("loop-in-file", loop=described(spacecraft.loop))
    pairs = () if dispersions is None else dispersions.correlation
    if pairs:
        correlated = (
            f"{in_words(first)} and {in_words(second)} {size:g}" for first, second, size in pairs
        )
        yield note("correlated-inputs", inputs="; ".join(correlated))


def _spin_axis(spacecraft: Spacecraft) -> Iterator[tuple[str, str]]:
    spin = capability.spin_axis(spacecraft)
    still = (
        "ω stands still in the body" if spacecraft.inertia.wheel else "a sphere, no axis is special"
    )
    stable = f"stable, p² = {spin.exponent:.4g} / s²" if spin.exponent < 0.0 else still
    by_shape = spin.kind == "minimum" and not spacecraft.inertia.wheel
    unstable = " (not under dissipation)" if by_shape or spacecraft.growth > 0.0 else ""
    yield "spin axis", f"{spin.kind} moment of inertia; {stable}{unstable}"
    body, despun, inertial = spin.rates
    yield (
        "nutation rate",
        f"{body:.4g} in the body, {despun:.4g} despun, {inertial:.4g} inertially, rad/s",
    )
    if not spacecraft.inertia.aligned:
        for number, axis in enumerate(spacecraft.inertia.axes.T, start=1):
            yield f"principal axis {number}", f"{vector(axis)} in the axes of the file"


def sun_pulse_facts(spacecraft: Spacecraft) -> Iterator[tuple[str, str]]:
    """Times of the Sun pulses, and resolution of the timing of blocks by them."""
    clock = capability.sun_clock(spacecraft)
    sensor = spacecraft.sun_sensor
    commands = spacecraft.commands
    if clock is None or sensor is None:
        return
    low, high = (
        0.5 * math.pi - sensor.elevation + side * sensor.half_width for side in (-1.0, 1.0)
    )
    view = (
        f"sees the Sun from {degrees(max(low, 0.0))} to {degrees(min(high, math.pi))} off the "
        "spin axis"
    )
    yield (
        "Sun sensor",
        f"at azimuth {degrees(sensor.azimuth)}, jitter {duration(sensor.jitter)}; {view}",
    )
    first = clock.refusal if clock.first is None else f"the first at {moment(clock.first)}"
    yield "Sun pulses", f"one every {duration(clock.turn)} on average; {first}"
    if commands is not None:
        delays = (commands.delay_step, commands.delay_max)
        spin = abs(spacecraft.spin)
        step, longest = (f"{duration(time)} = {degrees(spin * time)}" for time in delays)
        clocked = "angle, " if commands.delay_is == ANGLE else ""
        yield "delay", f"{clocked}in steps of {step} of spin, up to {longest}"
        widths = [duration(width) for width in commands.widths.tolist()]
        stepped = commands.width_step
        steps = (
            ""
            if stepped is None
            else f"in steps of {duration(stepped)}, {widths[0]} to {widths[-1]}"
        )
        yield Shared.ON_TIME, steps or listed(widths, "or")
        every = listed([str(count) for count in commands.every], "or")
        together = "; two in the same turns" if commands.per_turn > 1 else ""
        counted = f"at most {commands.max_count} pulses; every: {every} of the turns"
        yield "block", f"{counted}{together}"


def check_json(reports: list[dict[str, Any]]) -> dict[str, Any]:
    """Result of ``check --json``: all files."""
    return {"nutdamp": __version__, "files": reports}


def failed_json(
    name: str | None, wrong: FaultyFile | CannotRead, doubts: Sequence[Fault] = ()
) -> dict[str, Any]:
    """A file that could not be read or is faulty; ``doubts`` are warnings."""
    faults = (
        [Fault(wrong.path, 0, 0, "", wrong.reason)]
        if isinstance(wrong, CannotRead)
        else wrong.faults
    )
    report = {
        "file": name,
        "valid": False,
        "faults": _faults_json(faults),
        "warnings": _faults_json(doubts),
    }
    return report | {"spacecraft": None, "channels": [], "two_pulse": None}


def _faults_json(faults: Sequence[Fault]) -> list[dict[str, Any]]:
    """Faults, each with its ``place`` as messages have it; line and column are null where it is no
    place in a file.
    """
    return [
        {
            "place": fault.place,
            "line": fault.line or None,
            "column": fault.column or None,
            **values_of(fault, "where", "problem"),
        }
        for fault in faults
    ]


@dataclass(frozen=True, eq=False)
class CheckedFile(Data):
    """A valid ``spacecraft`` file, with ``doubts``: warnings on unlikely numbers; ``data``: its
    entry in JSON.
    """

    spacecraft: Spacecraft
    doubts: tuple[Fault, ...]
    data: Mapping[str, Any] = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Entry of the file in ``check --json``."""
        return finite(dict(self.data))


def checked(
    source: Source,
    name: str | None,
    doubts: list[Fault],
    warn: Callable[[Fault], object] = lambda _: None,
) -> CheckedFile:
    """Check of a source called ``name``; ``doubts`` are added to the list, and ``warn`` is called
    with each.

    Derived quantities may be faulty, too. Raises FaultyFile.
    """
    spacecraft = source.read(doubts.append)
    for doubt in doubts:
        warn(doubt)
    try:
        return CheckedFile(spacecraft, tuple(doubts), checked_json(name, spacecraft, doubts))
    except NutdampError as wrong:
        raise FaultyFile([Fault(name or source.name, 1, 1, "", str(wrong))]) from wrong


def checked_json(
    name: str | None, spacecraft: Spacecraft, doubts: Sequence[Fault] = ()
) -> dict[str, Any]:
    """A valid file: derived quantities, channels with their steps, the mounting angle for two
    pulses.
    """
    pair = capability.nearest_pair(spacecraft)
    axis = capability.spin_axis(spacecraft)
    clock = capability.sun_clock(spacecraft)
    commands = spacecraft.commands
    channels = channel_table(spacecraft).json()
    pulses = capability.acting(spacecraft)
    for entry, channel in zip(channels, spacecraft.channels, strict=True):
        if channel.valve is not None:
            own = [[pulse] for pulse in pulses if pulse.channel is channel]
            entry["commands"] = DataTable("", VALVES, own).json()
    inputs, unused = ((), ()) if spacecraft.dispersions is None else reachable(spacecraft)
    return {
        "file": name,
        "valid": True,
        "faults": [],
        "warnings": _faults_json(doubts),
        "notes": [
            note_json(entry)
            for entry in ordered((*warnings(spacecraft), *_notes(spacecraft, verbose=True)))
        ],
        "spacecraft": spacecraft_json(spacecraft),
        "channels": channels,
        **({} if spacecraft.tank is None else {"tank": tank_table(spacecraft.tank).json()}),
        "spin_axis": {
            **values_of(
                axis, "class=kind", "squared_exponent_1_s2=exponent", "growth_time_s", "tilt_deg"
            ),
            **{
                f"nutation_rate_{frame}_rad_s": rate for frame, rate in axis.rates._asdict().items()
            },
            "dissipation_growth_1_s": spacecraft.growth,
        },
        **aspects_json(at_start(spacecraft)),
        "sun": None if spacecraft.sun is None else direction_json(spacecraft, spacecraft.sun),
        "sun_pulses": clock
        and {
            **values_of(clock, "period_s=turn", "first_s"),
            "why": clock.refusal or None,
            "delay_step_deg": commands and math.degrees(abs(spacecraft.spin)) * commands.delay_step,
            "delay_max_deg": commands and math.degrees(abs(spacecraft.spin)) * commands.delay_max,
            "channels": turn_table(spacecraft).json(),
        },
        "disturbances": disturbance_table(spacecraft).json(),
        **(
            {}
            if spacecraft.loop is None
            else {"loop": margin_table(margins(spacecraft, spacecraft.loop)).json()}
        ),
        "dispersions": spacecraft.dispersions
        and {
            "inputs": [entry._asdict() for entry in inputs],
            "unused": dict(unused),
            **correlation_json(spacecraft),
        },
        "two_pulse": {
            "mounting_angle_deg": math.degrees(capability.mounting_angle(spacecraft)),
            "nearest": None if pair is None else [pair.first.name, pair.second.name],
            "nearest_off_deg": None if pair is None else abs(math.degrees(pair.miss)),
        },
    }

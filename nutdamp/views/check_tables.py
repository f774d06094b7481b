"""The screen of ``check``: derived quantities, capability of each channel, and the mounting angle for two pulses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.errors import listed
from nutdamp.physics.thruster import Cold, Tank
from nutdamp.spacecraft.equipment import Channel, SunSensor
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.units import bar
from nutdamp.views import survey
from nutdamp.views.layout import columns
from nutdamp.views.plan_tables import header
from nutdamp.views.text import degrees, duration, in_degrees, moment, quantity, vector


def check_screen(spacecraft: Spacecraft) -> RenderableType:
    """All tables of ``check`` for one valid file."""
    more = (*_spin_axis(spacecraft), *sun_pulse_facts(spacecraft))
    parts: list[RenderableType] = [header(spacecraft, more)]
    if spacecraft.channels:
        parts += [Text(), channel_table(spacecraft)]
    turns = survey.turns(spacecraft)
    if turns:
        parts += [Text(), turns_table(turns)]
    if survey.acting(spacecraft):
        parts += [Text(), valve_table(spacecraft)]
    for change in thrust_changes(spacecraft):
        parts += [Text(), Text(change)]
    if spacecraft.disturbances:
        parts += [Text(), disturbance_table(spacecraft)]
    parts += [Text(), _mounting(spacecraft)]
    if spacecraft.loop is not None:
        parts += [Text(), *_loop(spacecraft)]
    if spacecraft.dispersions is not None:
        parts += [Text(), *_dispersions(spacecraft)]
    return Group(*parts)


def _spin_axis(spacecraft: Spacecraft) -> Iterator[tuple[str, str]]:
    spin = survey.spin_axis(spacecraft)
    stable = f"stable, p² = {spin.exponent:.4g} / s²" if spin.exponent < 0.0 else "a sphere, no axis is special"
    warning = " (not under dissipation)" if spin.kind == "minimum" else ""
    yield "spin axis", f"{spin.kind} moment of inertia; {stable}{warning}"
    body, despun, inertial = spin.rates
    yield "nutation rate", f"{body:.4g} in the body, {despun:.4g} despun, {inertial:.4g} inertially, rad/s"
    if not spacecraft.inertia.aligned:
        yield "wobble", f"principal axis 3 is {degrees(spin.tilt)} off the third axis of the file"
        for number, axis in enumerate(spacecraft.inertia.axes.T, start=1):
            yield f"principal axis {number}", f"{vector(axis)} in the axes of the file"


def sun_pulse_facts(spacecraft: Spacecraft) -> Iterator[tuple[str, str]]:
    """Times of the Sun pulses, and resolution of the timing of blocks by them."""
    clock, sensor, commands = survey.sun_clock(spacecraft), spacecraft.sun_sensor, spacecraft.commands
    if clock is None or sensor is None:
        return
    yield "Sun sensor", f"at azimuth {degrees(sensor.azimuth)}, jitter {duration(sensor.jitter)}; {_view(sensor)}"
    first = clock.refusal if clock.first is None else f"the first at {moment(clock.first)}"
    yield "Sun pulses", f"one every {duration(clock.turn)} on average; {first}"
    if commands is not None:
        spin = abs(spacecraft.spin)
        step, longest = (
            f"{duration(time)} = {degrees(spin * time)}" for time in (commands.delay_step, commands.delay_max)
        )
        yield "delay", f"in steps of {step} of spin, up to {longest}"
        widths = [duration(width) for width in commands.widths.tolist()]
        step_of_widths = commands.width_step
        if step_of_widths is None:
            yield "width", listed(widths, "or")
        else:
            yield "width", f"in steps of {duration(step_of_widths)}, {widths[0]} to {widths[-1]}"
        every = listed([str(count) for count in commands.every], "or")
        yield "block", f"up to {commands.max_count} pulses, one every {'spin' if every == '1' else f'{every} spins'}"


def _view(sensor: SunSensor) -> str:
    """Range of angles from the spin axis in which the sensor sees the Sun."""
    low, high = (0.5 * math.pi - sensor.elevation + side * sensor.half_width for side in (-1.0, 1.0))
    return f"sees the Sun from {degrees(max(low, 0.0))} to {degrees(min(high, math.pi))} off the spin axis"


def turns_table(turns: Iterable[survey.Turns]) -> Table:
    """Turn of H by one pulse of a command block."""
    table = columns(
        "command blocks\n", "least turn of H\ndeg", "by a pulse of\n", "largest turn\ndeg", "by a pulse of\n"
    )
    for step in turns:
        ends = ((step.smallest, step.smallest_width), (step.largest, step.largest_width))
        cells = [text for turn, width in ends for text in (in_degrees(turn), duration(width))]
        table.add_row(step.channel.name, *cells)
    return table


def disturbance_table(spacecraft: Spacecraft) -> Table:
    """The forced tilt, the beat, or the times to reach a cone at resonance."""
    table = columns("disturbance", "does", text=("does",))
    for number, consequence in enumerate(survey.consequences(spacecraft), start=1):
        name = consequence.disturbance.name or f"number {number}"
        table.add_row(name, "; ".join(_consequences(consequence)))
    return table


def _consequences(consequence: survey.Consequence) -> list[str]:
    texts = []
    if consequence.resonant or consequence.tilt is None:
        reached = ", ".join(f"{degrees(mark)} after {duration(time)}" for mark, time in consequence.resonant)
        texts.append(f"resonant with the nutation: drives it to {reached}")
    elif consequence.disturbance.transverse != 0.0:
        texts.append(
            f"forces a tilt of {degrees(consequence.tilt)}, precession at {quantity(consequence.precession, 'rad/s')}; "
            f"from rest the nutation beats up to {degrees(consequence.beat)} "
            f"every {duration(consequence.beat_period)}"
        )
    if consequence.spin_rate != 0.0:
        texts.append(f"changes the spin by {consequence.spin_rate:.4g} rad/s²")
    return texts


def channel_table(spacecraft: Spacecraft) -> Table:
    """Torque, impulse and steps of each channel."""
    torque = "torque, file axes\nN m"
    table = columns("channel\n", torque, "on-time\n", "smallest step\ndeg", "largest step\ndeg", text=(torque,))
    for steps in survey.channel_steps(spacecraft):
        channel = steps.channel
        table.add_row(
            channel.name,
            vector(spacecraft.inertia.in_file(channel.torque)),
            _on_times(channel),
            "any" if steps.smallest == 0.0 else in_degrees(steps.smallest),
            in_degrees(steps.largest),
        )
    return table


def valve_table(spacecraft: Spacecraft) -> Table:
    """Pulses of the shortest and the longest command of each channel."""
    names = ("channel\n", "on-time\ncommanded", "effective\non-time", "impulse\nN m s", "centroid after\nthe start")
    table = columns(*names)
    alike: dict[tuple[str, ...], list[str]] = {}
    for pulse in survey.acting(spacecraft):
        times = (duration(time) for time in (pulse.on_time, pulse.effective))
        alike.setdefault((*times, f"{pulse.impulse:.4g}", duration(pulse.centroid)), []).append(pulse.channel.name)
    for cells, channels in alike.items():
        table.add_row(", ".join(channels), *cells)
    return table


def thrust_changes(spacecraft: Spacecraft) -> Iterator[str]:
    """Effect of cold nozzles and of a tank in blowdown on the thrust, a sentence or two each."""
    if spacecraft.cold is not None:
        yield _cold(spacecraft.cold)
    if spacecraft.tank is not None:
        yield _tank(spacecraft.tank)


def _cold(cold: Cold) -> str:
    levels = ", ".join(f"{100.0 * cold.factor(before):.4g}" for before in range(3))
    return f"Cold nozzles: the first pulses of a channel have {levels} % … of the thrust."


def _tank(tank: Tank) -> str:
    empty = tank.pressure_after(tank.propellant)
    levels = "; ".join(
        f"{bar(tank.pressure_after(used))} and {100.0 * tank.thrust_factor(used):.4g} % of the thrust with "
        f"{used:.4g} kg used"
        for used in (0.5 * tank.propellant, tank.propellant)
    )
    isp = tank.isp_after(0.0), tank.isp_after(tank.propellant)
    falls = "" if None in isp else f" Specific impulse: {isp[0]:.4g} s full, {isp[1]:.4g} s at {bar(empty)}."
    return f"Tank: {bar(tank.pressure)} full; {levels}.{falls}"


def _on_times(channel: Channel) -> str:
    most = "any" if math.isinf(channel.max_on_time) else duration(channel.max_on_time)
    return f"{duration(channel.min_on_time)} to {most}"


def _mounting(spacecraft: Spacecraft) -> RenderableType:
    """Magnus' two fixed actuators, and the channels that come nearest to them."""
    angle = survey.mounting_angle(spacecraft)
    lines = [
        f"Two fixed actuators, each pushing both ways, give both half pulses if mounted {math.degrees(angle):.2f} deg "
        "apart about axis 3, from the first fired to the second."
    ]
    pair = survey.nearest_pair(spacecraft)
    if pair is not None:
        lines.append(
            f"Of the channels {pair.first.name} then {pair.second.name} come nearest to that half a nutation turn "
            f"apart: the second is {abs(math.degrees(pair.miss)):.2f} deg off. `plan` may wait longer or shorter, and "
            "the second is then off by another angle."
        )
    idle = [channel.name for channel in spacecraft.channels if not channel.damps]
    if idle:
        lines.append(f"Never fired for damping, more axial than transverse: {', '.join(idle)}.")
    return Text("\n".join(lines))


def _loop(spacecraft: Spacecraft) -> Iterator[RenderableType]:
    """The loop, the margins of its channels before they feed the nutation, and the warnings of those that do."""
    from nutdamp.control_loop.stability import margins
    from nutdamp.views.loop_tables import described, margin_table, warnings

    assert spacecraft.loop is not None
    yield Text(described(spacecraft.loop))
    yield margin_table(margins(spacecraft, spacecraft.loop))
    for warning in warnings(spacecraft):
        yield Text.assemble(("Warning: ", "bold red"), f"{warning}.")


def _dispersions(spacecraft: Spacecraft) -> Iterator[RenderableType]:
    """Differences allowed between true values and the file's, and tolerances without effect on any actuator."""
    from nutdamp.montecarlo.inputs import reachable
    from nutdamp.views.tolerances import in_words, size_text, unused_table

    inputs, unused = reachable(spacecraft)
    alike: dict[tuple[str, str, str], list[str]] = {}
    for entry in inputs:
        names = alike.setdefault((in_words(entry.tolerance), entry.kind, size_text(entry)), [])
        by_thruster = getattr(spacecraft.dispersions, entry.tolerance)
        rest = entry.name.partition(" ")[2]  # the thruster, and behind a blank the axis
        if isinstance(by_thruster, Mapping):
            names += [name for name in by_thruster if name in (rest, rest[:-2]) and name not in names]
    table = columns("dispersion", "distribution", "one sigma or bias", "thrusters", text=("distribution", "thrusters"))
    for (tolerance, kind, size), names in alike.items():
        table.add_row(tolerance, kind, size, ", ".join(names))
    yield table
    given = () if spacecraft.dispersions is None else spacecraft.dispersions.correlation
    pairs = [f"{in_words(first)} and {in_words(second)} {size:g}" for first, second, size in given]
    if pairs:
        yield Text(f"Correlated: {', '.join(pairs)}.")
    if unused:
        yield Text()
        yield Text("Dispersions without effect on anything that fires", style="bold")
        yield unused_table(unused)

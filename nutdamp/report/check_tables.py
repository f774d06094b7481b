"""The screen of ``check``: derived quantities, what each channel can do, and the mounting angle for two pulses."""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp import survey
from nutdamp.report.layout import columns, facts
from nutdamp.report.plan_tables import header
from nutdamp.report.text import degrees, duration, vector
from nutdamp.spacecraft import Channel, Spacecraft


def check_screen(spacecraft: Spacecraft) -> RenderableType:
    """Everything that ``check`` shows of one valid file."""
    parts: list[RenderableType] = [header(spacecraft)]
    if not spacecraft.inertia.aligned:
        parts.append(_axes(spacecraft))
    if spacecraft.channels:
        parts += [Text(), _channels(spacecraft)]
    parts += [Text(), _mounting(spacecraft)]
    return Group(*parts)


def _axes(spacecraft: Spacecraft) -> RenderableType:
    table = facts()
    for number, axis in enumerate(spacecraft.inertia.axes.T, start=1):
        table.add_row(f"principal axis {number}", f"{vector(axis)} in the axes of the file")
    return table


def _channels(spacecraft: Spacecraft) -> Table:
    torque = "torque, file axes\nN m"
    table = columns("channel\n", torque, "on-time\n", "smallest step\ndeg", "largest step\ndeg", text=(torque,))
    for steps in survey.channel_steps(spacecraft):
        channel = steps.channel
        table.add_row(
            channel.name,
            vector(spacecraft.inertia.axes @ channel.torque),
            _on_times(channel),
            "any" if steps.smallest == 0.0 else degrees(steps.smallest).removesuffix(" deg"),
            degrees(steps.largest).removesuffix(" deg"),
        )
    return table


def _on_times(channel: Channel) -> str:
    most = "any" if math.isinf(channel.max_on_time) else duration(channel.max_on_time)
    return f"{duration(channel.min_on_time)} to {most}"


def _mounting(spacecraft: Spacecraft) -> RenderableType:
    """Magnus' two fixed actuators, and which channels come nearest to them."""
    angle = survey.mounting_angle(spacecraft)
    lines = [
        f"Two fixed actuators, each pushing both ways, give both half pulses if mounted {math.degrees(angle):.2f} deg "
        "apart about axis 3, from the first fired to the second."
    ]
    pair = survey.nearest_pair(spacecraft)
    if pair is not None:
        lines.append(
            f"Nearest of the channels: {pair.first.name} then {pair.second.name}, "
            f"{abs(math.degrees(pair.miss)):.2f} deg off."
        )
    idle = [channel.name for channel in spacecraft.channels if not channel.damps]
    if idle:
        lines.append(f"Never fired for damping, more axial than transverse: {', '.join(idle)}.")
    return Text("\n".join(lines))

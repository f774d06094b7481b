"""Result of ``check --json``: faults, or derived quantities, of each file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from nutdamp import __version__
from nutdamp.common.numerics import finite
from nutdamp.common.results import Data
from nutdamp.errors import CannotRead, Fault, FaultyFile, NutdampError
from nutdamp.files.reader import Source
from nutdamp.flight.end_state import at_start
from nutdamp.physics.thruster import Tank
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views import survey
from nutdamp.views.plan_json import aspects_json, spacecraft_json


def check_json(reports: list[dict[str, Any]]) -> dict[str, Any]:
    """All files."""
    return {"nutdamp": __version__, "files": reports}


def failed_json(name: str | None, wrong: FaultyFile | CannotRead, doubts: Iterable[Fault] = ()) -> dict[str, Any]:
    """A file that could not be read or is faulty; ``doubts`` are warnings."""
    faults = [Fault(wrong.path, 0, 0, "", wrong.reason)] if isinstance(wrong, CannotRead) else wrong.faults
    return {
        "file": name,
        "valid": False,
        "faults": _faults_json(faults),
        "warnings": _faults_json(doubts),
        "spacecraft": None,
        "channels": [],
        "two_pulse": None,
    }


def _faults_json(faults: Iterable[Fault]) -> list[dict[str, Any]]:
    """Faults, each with its ``place`` as messages have it; line and column are null where it is no place in a file."""
    return [
        {
            "place": fault.place,
            "line": fault.line or None,
            "column": fault.column or None,
            "where": fault.where,
            "problem": fault.problem,
        }
        for fault in faults
    ]


@dataclass(frozen=True, eq=False)
class CheckedFile(Data):
    """A valid ``spacecraft`` file, with ``doubts`` on numbers that are hardly meant."""

    spacecraft: Spacecraft
    doubts: tuple[Fault, ...]
    data: Mapping[str, Any] = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Entry of the file in ``check --json``."""
        return finite(dict(self.data))


def checked(
    source: Source, name: str | None, doubts: list[Fault], warn: Callable[[Fault], object] = lambda _: None
) -> CheckedFile:
    """Check of a source called ``name``; ``doubts`` are added to the list, and ``warn`` is called with each.

    Derived quantities may be faulty, too. Raises FaultyFile.
    """
    body = source.read(doubts.append)
    for doubt in doubts:
        warn(doubt)
    try:
        return CheckedFile(body, tuple(doubts), checked_json(name, body, doubts))
    except NutdampError as wrong:
        raise FaultyFile([Fault(name or source.name, 1, 1, "", str(wrong))]) from wrong


def checked_json(name: str | None, spacecraft: Spacecraft, doubts: Iterable[Fault] = ()) -> dict[str, Any]:
    """A valid file: derived quantities, channels with their steps, the mounting angle for two pulses."""
    pair = survey.nearest_pair(spacecraft)
    return {
        "file": name,
        "valid": True,
        "faults": [],
        "warnings": _faults_json(doubts),
        "spacecraft": spacecraft_json(spacecraft),
        "channels": [
            {
                "name": steps.channel.name,
                "torque_Nm": spacecraft.inertia.in_file(steps.channel.torque).tolist(),
                "min_on_time_s": steps.channel.min_on_time,
                "max_on_time_s": steps.channel.max_on_time,
                "smallest_step_deg": math.degrees(steps.smallest),
                "largest_step_deg": math.degrees(steps.largest),
                "damps": steps.channel.damps,
                **_valve_json(steps.channel, spacecraft),
            }
            for steps in survey.channel_steps(spacecraft)
        ],
        **_tank_json(spacecraft.tank),
        "spin_axis": _spin_axis_json(spacecraft),
        **aspects_json(at_start(spacecraft)),
        "sun_pulses": _sun_pulses_json(spacecraft),
        "disturbances": [
            {
                "name": consequence.disturbance.name or None,
                "precession_rad_s": consequence.precession,
                "forced_tilt_deg": None if consequence.tilt is None else math.degrees(consequence.tilt),
                "beat_deg": None if consequence.beat is None else math.degrees(consequence.beat),
                "beat_period_s": consequence.beat_period,
                "reaches": [{"nutation_deg": math.degrees(mark), "t_s": time} for mark, time in consequence.resonant],
                "spin_rate_rad_s2": consequence.spin_rate,
            }
            for consequence in survey.consequences(spacecraft)
        ],
        **_loop_json(spacecraft),
        "dispersions": _dispersions_json(spacecraft),
        "two_pulse": {
            "mounting_angle_deg": math.degrees(survey.mounting_angle(spacecraft)),
            "nearest": None if pair is None else [pair.first.name, pair.second.name],
            "nearest_off_deg": None if pair is None else abs(math.degrees(pair.miss)),
        },
    }


def _valve_json(channel: Channel, spacecraft: Spacecraft) -> dict[str, Any]:
    """Pulses of the shortest and the longest command of a channel; nothing without a valve."""
    if channel.valve is None:
        return {}
    return {
        "commands": [
            {
                "on_time_s": pulse.on_time,
                "effective_on_time_s": pulse.effective,
                "impulse_Nms": pulse.impulse,
                "centroid_s": pulse.centroid,
            }
            for pulse in survey.acting(spacecraft)
            if pulse.channel is channel
        ]
    }


def _tank_json(tank: Tank | None) -> dict[str, Any]:
    """Pressure and thrust of a tank full, half used and empty; nothing without one."""
    if tank is None:
        return {}
    rows = [
        {
            "used_kg": used,
            "pressure_Pa": tank.pressure_after(used),
            "thrust_factor": tank.thrust_factor(used),
            "isp_s": tank.isp_after(used),
        }
        for used in (0.0, 0.5 * tank.propellant, tank.propellant)
    ]
    return {"tank": rows}


def _spin_axis_json(spacecraft: Spacecraft) -> dict[str, Any]:
    axis = survey.spin_axis(spacecraft)
    return {
        "class": axis.kind,
        "squared_exponent_1_s2": axis.exponent,
        "growth_time_s": axis.growth_time,
        "tilt_deg": math.degrees(axis.tilt),
        "nutation_rate_body_rad_s": axis.rates.body,
        "nutation_rate_despun_rad_s": axis.rates.despun,
        "nutation_rate_inertial_rad_s": axis.rates.inertial,
        "dissipation_growth_1_s": spacecraft.growth,
    }


def _sun_pulses_json(spacecraft: Spacecraft) -> dict[str, Any] | None:
    """Times of the Sun pulses, and capability of command blocks; None without Sun or sensor in the file."""
    clock, commands = survey.sun_clock(spacecraft), spacecraft.commands
    if clock is None:
        return None
    spin = math.degrees(abs(spacecraft.spin))
    return {
        "period_s": clock.turn,
        "first_s": clock.first,
        "why": clock.refusal or None,
        "delay_step_deg": None if commands is None else spin * commands.delay_step,
        "delay_max_deg": None if commands is None else spin * commands.delay_max,
        "channels": [
            {
                "name": turn.channel.name,
                "smallest_turn_deg": math.degrees(turn.smallest),
                "smallest_turn_width_s": turn.smallest_width,
                "largest_turn_deg": math.degrees(turn.largest),
                "largest_turn_width_s": turn.largest_width,
            }
            for turn in survey.turns(spacecraft)
        ],
    }


def _loop_json(spacecraft: Spacecraft) -> dict[str, Any]:
    """Margins of the channels of a loop before they feed the nutation; nothing for a file without one."""
    if spacecraft.loop is None:
        return {}
    from nutdamp.control_loop.stability import margins
    from nutdamp.views.loop_json import margins_json

    return {"loop": margins_json(margins(spacecraft, spacecraft.loop))}


def _dispersions_json(spacecraft: Spacecraft) -> dict[str, Any] | None:
    """Inputs that a study could draw, sizes in SI or as factors, and those without effect on any actuator."""
    if spacecraft.dispersions is None:
        return None
    from nutdamp.montecarlo.inputs import reachable

    inputs, unused = reachable(spacecraft)
    from nutdamp.views.dispersion import correlation_json

    return {
        "inputs": [entry._asdict() for entry in inputs],
        "unused": {entry.name: entry.reason for entry in unused},
        **correlation_json(spacecraft),
    }

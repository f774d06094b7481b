"""The manoeuvre sheet: commands to load, readings of gyros and Sun sensor to expect, and abort criteria."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.errors import listed
from nutdamp.flight.end_state import spin_phases
from nutdamp.flight.propagation import Flight
from nutdamp.page.document import Block, FactList, PageSection, Prose, Sheet, sheet
from nutdamp.page.sheets import on_times
from nutdamp.physics import attitude
from nutdamp.physics import body as rigid_body
from nutdamp.planning.plan import Plan
from nutdamp.schemes.block_model import to_sun_pulse
from nutdamp.schemes.catalogue import COMMANDED
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.views import verdicts
from nutdamp.views.pulses import MILLISECONDS, block_table, channel_text
from nutdamp.views.tables import Heading
from nutdamp.views.text import MISSING, RPM, digits, in_degrees, longitude

if TYPE_CHECKING:
    from nutdamp.montecarlo.study import Results


CHECKED = 12
"""Largest number of pulses after which there are abort criteria."""

FITTING = 5
"""Columns of short values that a phone shows side by side."""

STILL = 1e-9
"""deg/s of transverse rate, below which it is rounding."""


def manoeuvre_section(plan: Plan, dispersed: Results | None) -> PageSection:
    """The sheet of a plan; with its ``dispersed`` cases there are abort criteria."""
    return PageSection("manoeuvre", f"Manoeuvre sheet: {plan.scheme}", tuple(_blocks(plan, dispersed)))


def _blocks(plan: Plan, dispersed: Results | None) -> Iterator[Block]:
    flown, body = plan.flight, plan.spacecraft
    if not len(plan.pulses):
        yield Prose("No pulse is needed.")
        return
    if plan.pulses.blocks:
        yield sheet("Command blocks to load", block_table(flown))
    yield _firing(flown)
    if body.commands is not None and not plan.pulses.blocks:
        yield Prose(f"No command block fires these pulses; {listed(COMMANDED)} plans with the commands of the file.")
    if plan.pulses.idealised:
        yield Prose(
            "On-time “ideal”: an impulse that takes no time, which no thruster gives; with steerable.torque in the "
            "file it has an on-time."
        )
    yield Prose(_phases(plan))
    if any(pulse.channel == STEERABLE for pulse in plan.pulses):
        yield Prose("The angle beside steerable is the direction of its torque, from body axis +1 towards +2.")
    yield _signature(flown)
    swings = " The Sun angle is that of H; the spin axis swings about it by the nutation."
    yield Prose(
        "Gyro, square to axis 3: the largest transverse rate on the coast; about a fixed axis it oscillates with the "
        "period given. Gyro, axis 3: the spin." + swings * (body.sun is not None)
    )
    if dispersed is not None:
        yield from _criteria(flown, dispersed)
        return
    how = "report --disperse flies them" if body.dispersions is not None else "the file gives no dispersions"
    yield FactList("Abort criteria", (("not known", f"they come from dispersed cases; {how}"),))


def _phases(plan: Plan) -> str:
    """Notes on the reference of the phases of pulses and of the delays of blocks."""
    spin = "Spin phase: the angle by which the body has turned about axis 3 since t = 0"
    spin += ", positive about +3, so that it falls with this spin" * (plan.spacecraft.spin < 0.0)
    if not _senses(plan.spacecraft):
        return f"{spin}, at the commanded start, modulo 360 deg."
    delays = " A delay in deg is the delay times the spin: nutation near the Sun makes the Sun phase another angle."
    return (
        f"{spin}. Sun phase: the angle from the Sun sensor to the Sun about axis 3, against the spin. Both at the "
        "commanded start, modulo 360 deg." + delays * bool(plan.pulses.blocks)
    )


def _senses(body: Spacecraft) -> bool:
    return body.sun is not None and body.sun_sensor is not None


def _firing(flown: Flight) -> Sheet:
    """One row a pulse: time, phases, duration, channel."""
    body, pulses = flown.spacecraft, flown.schedule.pulses
    starts = np.array([pulse.loaded[0] for pulse in pulses])
    columns: list[tuple[Heading, list[str]]] = [
        (Heading("pulse"), [str(index + 1) for index in range(len(pulses))]),
        *_when(body, starts),
        (Heading("spin phase", "deg"), _angles(spin_phases(flown, starts))),
    ]
    if _senses(body):
        columns.append((Heading("Sun phase", "deg"), _angles(-to_sun_pulse(flown, starts))))
    columns += [
        on_times(flown.schedule),
        (Heading("channel", number=False), [channel_text(pulse, body) for pulse in pulses]),
    ]
    if flown.schedule.idealised:
        columns.append((Heading("impulse", "N m s"), [digits(pulse.magnitude, 4) for pulse in pulses]))
    wide = len(columns) > FITTING or any(pulse.channel == STEERABLE for pulse in pulses)
    return _sheet("Pulses to fire", columns, stacked=wide)


def _signature(flown: Flight) -> Sheet:
    """One row for the coast before the first pulse or block, and one after each: expected readings of sensors."""
    body, schedule = flown.spacecraft, flown.schedule
    before, after = flown.around_pulses()
    counts = np.arange(1, len(schedule) + 1)
    if schedule.blocks:
        counts = np.cumsum([block.count for block in schedule.blocks])
    rows = counts - 1
    fired = "block" if schedule.blocks else "pulse"
    names = [f"before {fired} 1", *(f"after {fired} {index}" for index in range(1, len(counts) + 1))]

    def states(name: str) -> Vector:
        return np.concatenate([getattr(before, name)[:1], getattr(after, name)[rows]])

    spins, nutation = states("rates")[:, 2], states("nutation")
    across = np.abs(spins) * np.tan(states("body_cone"))
    moments = body.inertia
    shape = moments.nutating, moments.C
    inertial = [rigid_body.inertial_period(*shape, *rate) for rate in zip(across, spins, strict=True)]
    in_body = [rigid_body.body_period(*shape, spin) for spin in spins.tolist()]
    turns = np.isfinite(in_body) & (np.degrees(across) >= STILL)
    periods = [digits(time, 4) if there else MISSING for time, there in zip(in_body, turns, strict=True)]
    columns: list[tuple[Heading, list[str]]] = [
        (Heading("coast", number=False), names),
        *_when(body, states("t")),
        (Heading("gyro, axis 3", "rpm"), _rpm(spins)),
        (Heading("gyro, square to it", "deg/s"), [_small(math.degrees(rate)) for rate in across.tolist()]),
        (Heading("period of that rate", "s"), periods),
        (Heading("nutation", "deg"), _plain(nutation)),
        (Heading("nutation period", "s"), [digits(time, 4) for time in inertial]),
    ]
    if body.sun is not None:
        columns.append((Heading("Sun angle", "deg"), _plain(attitude.angle_between(states("momentum"), body.sun))))
    return _sheet(f"What gyros{' and Sun sensor' * (body.sun is not None)} should show", columns, stacked=True)


def _criteria(flown: Flight, dispersed: Results) -> Iterator[Block]:
    """Limits after some pulses that most of the dispersed cases stay within."""
    from nutdamp.montecarlo.checkpoints import CASES, even, milestones

    body, probability = flown.spacecraft, dispersed.probability
    counts = even(len(flown.schedule), CHECKED)
    criteria = list(milestones(dispersed.study, counts, probability))
    _, after = flown.around_pulses()
    rows = np.array(counts) - 1
    limits = np.array([criterion.nutation for criterion in criteria])
    required = None if body.requirement is None else body.requirement.nutation
    stricter = required is not None and required < float(limits[-1])
    if stricter:
        limits[-1] = required
    columns: list[tuple[Heading, list[str]]] = [
        (Heading("after pulse"), list(map(str, counts))),
        *_when(body, after.t[rows]),
        (Heading("nutation, nominal", "deg"), _plain(after.nutation[rows])),
        (Heading("nutation: abort above", "deg"), _plain(limits)),
    ]
    if body.sun is not None:
        nominal = attitude.angle_between(after.momentum[rows], body.sun)
        ranges = np.array([criterion.sun_angle for criterion in criteria if criterion.sun_angle is not None])
        columns.append((Heading("Sun angle, nominal", "deg"), _plain(nominal)))
        columns += [
            (Heading(f"Sun angle: abort {side}", "deg"), _plain(ranges[:, index]))
            for index, side in enumerate(("below", "above"))
        ]
    spins = np.array([criterion.spin for criterion in criteria])
    columns.append((Heading("spin, nominal", "rpm"), _rpm(after.rates[rows, 2])))
    columns += [
        (Heading(f"spin: abort {side}", "rpm"), _rpm(spins[:, index])) for index, side in enumerate(("below", "above"))
    ]
    yield _sheet("Abort criteria", columns, stacked=True)
    share = verdicts.exact_percent(probability)
    yield Prose(
        f"Abort, and plan anew from the measured attitude, where after a pulse one of these is exceeded: {share} of "
        f"{CASES:,} cases stay within each{' but the last of nutation' * stricter}, those without a "
        f"fault of thruster, valve or sensor. They are drawn from the dispersions of the file (seed "
        f"{dispersed.study.seed}) and flown for this table alone; their number is not that of --disperse."
    )
    if stricter:
        yield Prose(
            "After the last pulse the criterion of nutation is the requirement, which fewer cases meet: on the way a "
            "flight within the criteria may still come to miss it."
        )
    elif required is not None:
        yield Prose(
            "A flight that is beyond the criterion after the last pulse, yet meets the requirement, needs no new plan, "
            "but its cause should be found."
        )
    others = [bound.part.label for bound in requirements.required(body) if bound.part is not Part.NUTATION]
    if others:
        yield Prose(f"The criteria do not judge what is required of the {listed(others)}.")
    if len(counts) < len(flown.schedule):
        yield Prose(f"There are criteria after {CHECKED} pulses at most: the first, the last and some evenly between.")


def _when(body: Spacecraft, times: Vector) -> list[tuple[Heading, list[str]]]:
    """Columns of times from t = 0, and of dates where there is an epoch."""
    dates = [body.utc(time, MILLISECONDS) for time in times.tolist()]
    columns = [(Heading("time", "s"), [f"{time:.4f}" for time in times.tolist()])]
    return [*columns, (Heading("UTC", number=False), [date or MISSING for date in dates])] if any(dates) else columns


def _angles(phases: Vector) -> list[str]:
    """Angles from 0 to below 360 deg."""
    return [longitude(phase).removesuffix(" deg") for phase in phases.tolist()]


def _plain(angles: Vector) -> list[str]:
    return [in_degrees(angle) for angle in angles.tolist()]


def _rpm(spins: Vector) -> list[str]:
    return [digits(spin * RPM, 5) for spin in spins.tolist()]


def _small(value: float) -> str:
    return digits(value, 4) if abs(value) >= STILL else "0"


def _sheet(title: str, columns: list[tuple[Heading, list[str]]], *, stacked: bool = False) -> Sheet:
    rows = tuple(zip(*(cells for _, cells in columns), strict=True))
    return Sheet(title, tuple(column for column, _ in columns), rows, sortable=False, stacked=stacked)

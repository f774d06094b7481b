"""Dispersed loops: settling, end states, propellant and worst cases of many dispersed closed loops.

The law on board knows the spacecraft file alone. Body, thrusters, valves and sensor of a case are
drawn as for a schedule, by the same names from the same streams; of the sensor bias and scale of
each gyro, noise and delay.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.control_loop.controller import Case, Ending, Scatter
from nutdamp.control_loop.law import Law
from nutdamp.control_loop.simulation import (
    Fleet,
    FlownLoops,
    expects_alone,
    fly_alone,
    until_default,
)
from nutdamp.control_loop.stability import Band, dead_band, expect_in_time, held_by
from nutdamp.errors import BadRequest
from nutdamp.montecarlo.cases import (
    DispersedModel,
    cold_of,
    rotated,
    tank_of,
    tilt_quaternion,
    triple,
)
from nutdamp.montecarlo.inputs import (
    BLOCK,
    BY_VALVE,
    Draws,
    Inputs,
    independent,
    some_of,
    with_sensor,
)
from nutdamp.montecarlo.statistics import Exact, cases_to_show, correlated_shares
from nutdamp.montecarlo.study import Counted, Dispersed, DrawnCases, by_tolerance
from nutdamp.physics import attitude
from nutdamp.planning.verdict import Verdict, cases_of, judge_loop
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import ACCELEROMETER, Channel, Loop, Sensor
from nutdamp.spacecraft.model import Attitude, Inertia, Spacecraft, Vector, required_share
from nutdamp.spacecraft.requirements import Bound, Held
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.spacecraft.tolerances import expect_dispersions

OF_FIRINGS = ("thrust_per_pulse", "timing")  # tolerances that each firing draws anew


class LoopModel(DispersedModel):
    """Spacecraft as known to its ``law`` on board, ready to be dispersed; ``of_firings``: inputs
    drawn per firing.
    """

    def __init__(self, law: Law) -> None:
        pulses = [
            channel_pulse(actuator.channel, 0.0, actuator.shortest or 1.0)
            for actuator in law.actuators
        ]
        super().__init__(law.spacecraft, Schedule(tuple(pulses)))
        self.law = law
        drawn = self.inputs.drawn
        per_case = tuple(entry for entry in drawn if entry.tolerance not in OF_FIRINGS)
        self.inputs = with_sensor(
            self.spacecraft, Inputs(per_case, self.inputs.unused), "the loop does not fire"
        )
        each = {entry.tolerance: entry for entry in drawn if entry.tolerance in OF_FIRINGS}
        self.of_firings = tuple(entry._replace(name=name) for name, entry in each.items())

    def loops(self, draws: Draws, numbers: NDArray[np.intp], seed: int) -> list[Case]:
        """Cases of a study with these ``numbers``, from 0, and their ``draws``, (n,) or one for
        all.
        """
        spacecraft = self.spacecraft
        loop = self.law.loop
        dispersions = self.spacecraft.dispersions
        count = len(numbers)
        draws = _at_pressure(spacecraft, draws)

        def rows(*parts: Any) -> Vector:
            return np.array([np.broadcast_to(part, count) for part in parts]).T

        model = self.cases(draws)
        moments, wheels = rows(*model.moments).tolist(), rows(model.wheel)[:, 0].tolist()
        rates, tilts = rows(*model.omega0), rows(*model.tilt)
        turns = np.broadcast_to(
            np.eye(3)[..., None] if model.turn is None else model.turn, (3, 3, count)
        )
        attitudes = None if spacecraft.attitude is None else self._attitudes(tilts)
        torques = {
            thruster.name: rows(*self.thruster_torque(thruster, draws))
            * (1.0 + rows(draws.get(f"thrust {thruster.name}", 0.0)))
            for channel in spacecraft.channels
            for thruster in channel.thrusters
        }
        each_firing = (
            (None, None)
            if dispersions is None
            else (dispersions.thrust_per_pulse, dispersions.timing)
        )
        whole = {name: rows(draw)[:, 0].tolist() for name, draw in draws.items()}
        cases = []
        for row, number in enumerate(numbers.tolist()):
            draw = {name: values[row] for name, values in whole.items()}
            key = (seed, number + 1)
            truth = replace(
                spacecraft,
                inertia=Inertia(
                    triple(moments[row]), spacecraft.inertia.axes @ turns[..., row], wheels[row]
                ),
                omega0=rates[row],
                attitude=None if attitudes is None else Attitude(attitudes[row]),
                channels=self._channels(
                    draw, {name: torque[row] for name, torque in torques.items()}, turns[..., row]
                ),
                loop=replace(loop, sensor=_sensor(loop.sensor, draw, turns[..., row])),
                cold=cold_of(spacecraft, draw),
                tank=tank_of(spacecraft, draw),
            )
            scatter = Scatter(key, *each_firing, draw.get("timing offset", 0.0))
            cases.append(Case(truth, key, scatter, (float(tilts[row, 0]), float(tilts[row, 1]))))
        return cases

    def _attitudes(self, tilts: Vector) -> Vector:
        """Attitudes (n, 4) of the file's axes, where that of the principal axes is turned by
        ``tilts`` (n, 2) rad.
        """
        spacecraft = self.spacecraft
        turned = attitude.multiply(
            spacecraft.initial.quaternion, np.stack(tilt_quaternion(*tilts.T), axis=-1)
        )
        return attitude.multiply(turned, attitude.from_matrix(spacecraft.inertia.axes.T))

    def _channels(
        self, draw: dict[str, float], torques: dict[str, Vector], turn: Vector
    ) -> tuple[Channel, ...]:
        """Channels of a case, in its principal axes; undispersed ones are those of the file."""
        spacecraft = self.spacecraft
        names = {name.split()[1] for name in draw if name.split()[0] in OF_THRUSTERS}
        if any(name.startswith(("center of mass ", "inertia ")) for name in draw):
            names = {
                thruster.name for channel in spacecraft.channels for thruster in channel.thrusters
            }
        channels = []
        for channel in spacecraft.channels:
            if not names & {thruster.name for thruster in channel.thrusters}:
                channels.append(channel)
                continue
            valve = _valve(channel, draw)
            thrusters = []
            for thruster in channel.thrusters:
                factor = 1.0 + draw.get(f"thrust {thruster.name}", 0.0)
                force = None if thruster.force is None else factor * thruster.force @ turn
                thrust = None if thruster.thrust is None else factor * thruster.thrust
                torque = torques[thruster.name] @ turn
                thrusters.append(
                    replace(thruster, torque=torque, valve=valve, force=force, thrust=thrust)
                )
            channels.append(replace(channel, thrusters=tuple(thrusters)))
        return tuple(channels)


OF_THRUSTERS = (
    "thrust",
    "direction",
    "position",
    *BY_VALVE,
)  # first words of the inputs that make a thruster another


def _at_pressure(spacecraft: Spacecraft, draws: Draws) -> Draws:
    """Draws with the thrust at another tank pressure folded into that of the thrusters."""
    tank = tank_of(spacecraft, draws)
    if (
        spacecraft.tank is None
        or tank is None
        or not {"tank pressure", "tank exponent"} & set(draws)
    ):
        return draws
    higher = (tank.pressure / spacecraft.tank.pressure) ** tank.exponent
    names = {
        f"thrust {thruster.name}"
        for channel in spacecraft.channels
        for thruster in channel.thrusters
    }
    return {**draws, **{name: (1.0 + draws.get(name, 0.0)) * higher - 1.0 for name in names}}


def _valve(channel: Channel, draw: dict[str, float]) -> Any:
    """Valve of a channel: all of its thrusters open with the mean of their delays,
    none below zero.
    """
    valve = channel.valve
    if valve is None:
        return None

    def off(key: str) -> float:
        return float(
            np.mean([draw.get(f"{key} {thruster.name}", 0.0) for thruster in channel.thrusters])
        )

    from nutdamp.physics.thruster import Measured  # few spacecraft have any

    if isinstance(valve, Measured):
        factor = 1.0 + off("impulse_bit")
        return Measured(
            tuple(
                (command, factor * impulse, centroid) for command, impulse, centroid in valve.rows
            )
        )
    return replace(
        valve, **{key: max(getattr(valve, key) + off(key), 0.0) for key in BY_VALVE[:-1]}
    )


def _sensor(sensor: Sensor, draw: dict[str, float], turn: Vector) -> Sensor:
    axes = [""] if sensor.kind == ACCELEROMETER else [" 1", " 2"]
    scales = [sensor.scale * (1.0 + draw.get(f"sensor scale{axis}", 0.0)) for axis in axes]
    biases = [sensor.bias + draw.get(f"sensor bias{axis}", 0.0) for axis in axes]
    return replace(
        sensor,
        position=sensor.position @ turn,
        axis=sensor.axis @ turn,
        axes=sensor.axes @ turn,
        scale=scales[0],
        bias=biases[0],
        noise=sensor.noise * (1.0 + draw.get("sensor noise", 0.0)),
        delay=sensor.delay + draw.get("sensor delay", 0.0),
        second=(scales[1], biases[1]) if len(axes) == 2 else None,
    )


Array = NDArray[np.float64]

OUTPUTS = (
    "settled",
    "quiet",
    "nutation",
    "momentum_shift",
    "axis_error",
    "spin_change",
    "propellant",
    "firings",
)
"""Outputs of a case: first settling (s), nutation then and largest since (rad), by what H has
turned and is off its target at the end (rad), by how much the spin has changed (rad/s), propellant
(kg), firings.

What is not known is not a number: the first two of a loop that never falls quiet, or that never
sees its start.
"""

PORTION = 512  # cases that are flown together
CASES = (2_000, 20_000)  # least and largest number of cases flown where nothing else is said

MORE = 1.6
"""Factor on the fewest cases that show a share by which one of them may fail: 5.6 over 3.7, as
Poisson's limits are.
"""

MOST_SAMPLES = 20_000_000_000  # largest number of samples of a study, by those of its nominal case
ALONE = 20  # cost factor of a sample where cases fly alone
FEW = 100  # least number of settled cases for sensitivities


class LoopStudy(DrawnCases):
    """Loop flown to ``until`` s in dispersed cases; ``alone`` is why they fly one by one, empty
    where together.
    """

    model: LoopModel
    outputs = OUTPUTS

    def __init__(self, spacecraft: Spacecraft, loop: Loop, until: float, seed: int) -> None:
        self.spacecraft, self.until, self.seed, self.law = (
            spacecraft,
            until,
            seed,
            Law(spacecraft, loop),
        )
        self.model, self.alone = LoopModel(self.law), expects_alone(self.law, spacecraft)

    @cached_property
    def band(self) -> Band:
        """Nutation that the loop is designed to leave."""
        return dead_band(self.spacecraft, self.law.loop)

    def held_by(self, bound: Bound) -> Bound:
        """A bound as the loop holds it."""
        return held_by(self.law.loop, self.band, bound)

    def case(self, number: int) -> Case:
        """Case of a number."""
        return self.model.loops(self.draws_of(number), np.array([number]), self.seed)[0]

    @cached_property
    def nominal(self) -> Array:
        """Values (rows,) of the file itself, with the noise of the seed."""
        return np.asarray(self.measured(self._nominal_flown)[0][:, 0])

    @property
    def nominal_lost(self) -> bool:
        """True if the loop of the file fails whatever it leaves, see `Pilot`."""
        return self._nominal_flown.pilots[0].lost

    @property
    def nominal_aspects(self) -> Any:
        """Least and largest angle (m, 2) rad from the spin axis to the direction of each cone, of
        that flight.
        """
        return self.left(self.nominal).angles

    @cached_property
    def _nominal_flown(self) -> FlownLoops:
        return self.fly([Case(self.spacecraft, (self.seed,))])

    @property
    def enough(self) -> int:
        """Cases flown where nothing else is said: a share required is shown even where one of them
        fails.
        """
        shown = cases_to_show(required_share(self.spacecraft.requirement))
        return min(max(math.ceil(MORE * shown), CASES[0]), CASES[1])

    def expect_affordable(self, samples: int) -> int:
        """Number of samples of so many cases, by the nominal one; raises BadRequest where there are
        too many.
        """
        looked = self._nominal_flown.pilots[0].looked_at
        price = looked * (ALONE if self.alone else 1)
        if price * samples > MOST_SAMPLES:
            affordable = max(MOST_SAMPLES // price, 1)
            raise BadRequest(
                f"{samples} cases take about {looked * samples:.2g} sensor samples, too many; "
                f"use at most {affordable} --samples, or an earlier --until"
            )
        return looked * samples

    def price_alone(self, samples: int) -> str:
        """Time of so many cases one by one, in words,
        by that of the nominal one on this machine.
        """
        begin = time.perf_counter()
        self.fly([Case(self.spacecraft, (self.seed,))])
        seconds = samples * (time.perf_counter() - begin)
        return (
            f"about {math.ceil(seconds)} s"
            if seconds < 120.0
            else f"about {seconds / 60.0:.0f} min"
        )

    def fly(self, cases: list[Case], watch: Callable[[int], None] = lambda _: None) -> FlownLoops:
        """Fly the loops of ``cases``."""
        if self.alone:
            return fly_alone(self.law, cases, self.until, watch)
        return Fleet(self.law, cases, self.until).fly(watch)

    def measured(self, flown: FlownLoops) -> tuple[Array, Array]:
        """Values (rows, n) of loops, and their severity (n,): infinite where a loop is `lost`."""
        cases, pilots, spacecraft = flown.cases, flown.pilots, self.spacecraft
        before = np.array([case.truth.omega0 for case in cases]).T
        start, end = triple(flown.momentum(before)), triple(flown.momentum(flown.rates))
        axes = np.array([case.truth.inertia.axes for case in cases])
        turns = spacecraft.inertia.axes.T @ axes
        momentum = np.einsum("nij,jn->in", turns, attitude.turned(flown.quaternion, end))
        start = triple(np.einsum("nij,jn->in", turns, start))
        tilts = np.array([case.tilt for case in cases]).T
        out = np.empty((len(OUTPUTS), len(cases)))
        out[0] = [pilot.quiet[0] if pilot.quiet else math.nan for pilot in pilots]
        out[1], out[2] = flown.quiet, flown.largest
        out[3] = attitude.angle_of_parts(start, triple(momentum))
        out[4] = attitude.angle_of_parts(
            triple(self.model.target.tolist()), rotated(triple(momentum), (tilts[0], tilts[1]))
        )
        out[5] = flown.rates[2] - before[2]
        used = [[firing.pulse.propellant for firing in pilot.fired] for pilot in pilots]
        out[6] = [math.fsum(math.nan if kg is None else kg for kg in pulses) for pulses in used]
        out[7] = [len(pilot.fired) for pilot in pilots]
        rows = [out, flown.aspects.reshape(-1, len(cases))]
        if spacecraft.goal.spin is not None:
            rows.append(np.abs(flown.rates[2:] - spacecraft.goal.spin))
        values = np.concatenate(rows)
        lost = np.array([pilot.lost for pilot in pilots])
        severity = requirements.severity(spacecraft, self.left(values))
        return values, np.where(lost, math.inf, severity)


def loop_study(spacecraft: Spacecraft, until: float | None = None, *, seed: int = 1) -> LoopStudy:
    """Study of a loop; raises BadRequest without loop or dispersions, Infeasible as
    `evaluation.loop_of` does.
    """
    loop = requirements.expect_loop(spacecraft)
    expect_dispersions(spacecraft.dispersions)
    expect_in_time(spacecraft, loop)
    return LoopStudy(
        spacecraft, loop, until_default(spacecraft, loop) if until is None else until, seed
    )


@dataclass(eq=False)
class LoopResults(Counted):
    """Results of a study of a loop; cases that comply settle too.

    ``values`` (rows, requested) as of `DrawnCases`, ``lost`` (done,) the cases that see no end, or
    were stopped; ``stops`` is why loops were flown no further.
    """

    study: LoopStudy
    stops: Counter[Ending] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.bounds = tuple(map(self.study.held_by, self.bounds))
        self.values = np.empty((self.study.rows, self.requested))
        self.lost = np.zeros(0, dtype=bool)

    def of(self, output: str) -> Array:
        """Known values of an output, (m,)."""
        values = self.values[OUTPUTS.index(output), : self.done]
        return values[~np.isnan(values)]

    def distribution(self, output: str) -> Exact | None:
        """Distribution of the known values of an output; None where there are none."""
        values = self.of(output)
        return Exact(values) if len(values) else None

    @property
    def settled(self) -> int:
        """Cases that fall quiet, or never have to fire, and are not stopped."""
        return self.done - int(np.count_nonzero(self.lost))

    @property
    def idle(self) -> int:
        """Cases of them that never see the start threshold."""
        return int(np.count_nonzero(~self.lost & np.isnan(self.values[0, : self.done])))

    @property
    def within(self) -> int:
        """Cases that fall quiet with no more nutation than the dead band of the file."""
        return int(np.count_nonzero(self.of("quiet") <= self.study.band.most))

    def spread(self, bound: Bound) -> Exact | None:
        """Distribution of the value of a bound's part, of the cases that settle; None where none
        does.
        """
        if self.lost.all():
            return None
        return Exact(self.values[self.study.row_of(bound), : self.done][~self.lost])

    def take(self, values: Array, severity: Array, stops: list[Ending]) -> None:
        """Count further cases: `LoopStudy.measured`, and why they were flown no further."""
        self.values[:, self.done : self.done + len(severity)] = values
        self.stops.update(stops)
        lost = np.isinf(severity)
        self.lost = np.concatenate([self.lost, lost])
        self.count(severity, values, ~lost)

    def shares(self, output: str) -> dict[str, float]:
        """Share of each input in the variance of an output over the cases that settle: its squared
        correlation.

        What chance adds to that over few cases is taken off; empty where they are too few, or
        nothing varies. Of inputs that are correlated each has what it adds to those before it.
        """
        return self._shares(OUTPUTS.index(output))

    def _shares(self, row: int) -> dict[str, float]:
        values = self.values[row, : self.done]
        rows = np.flatnonzero(~self.lost & ~np.isnan(values))
        model = self.study.model
        if len(rows) < FEW:
            return {}
        inputs = [entry for entry in model.inputs.drawn if entry.sigma > 0.0]
        draws = self.study.draws_of_all(np.arange(self.done))
        drawn = independent(
            {entry.name: np.asarray(draws[entry.name]) for entry in inputs}, inputs, model.groups
        )
        return correlated_shares(
            {entry.name: drawn[entry.name][rows] for entry in inputs}, values[rows]
        )

    def contributions(self, bound: Bound) -> dict[str, float]:
        """Share of each tolerance in the variance of the value of a bound's part over the cases
        that settle.
        """
        model = self.study.model
        shares = self._shares(self.study.row_of(bound))
        return by_tolerance(model.inputs.drawn, model.groups, shares)


@dataclass(frozen=True, eq=False, repr=False)
class LoopDispersion(Dispersed):
    """Closed loop of a file flown in dispersed cases."""

    core: LoopResults

    @cached_property
    def verdict(self) -> Verdict:
        """Judgement of the loop by these cases,
        and by nominal values with the noise of the seed.
        """
        study, spacecraft = self.core.study, self.core.study.spacecraft
        held = [
            Held(study.held_by(line.bound), line.left)
            for line in requirements.held(spacecraft, study.left(study.nominal))
        ]
        return judge_loop(spacecraft, held, cases_of(self.core), self.core, lost=study.nominal_lost)


def run(
    results: LoopResults,
    *,
    watch: Callable[[int], None] = lambda _: None,
    stopped: Callable[[], bool] = lambda: False,
    collect: Callable[[int, Array, list[Ending]], None] | None = None,
) -> LoopResults:
    """Fly the cases that ``results`` is to have, a portion after the other; returns ``results``.

    ``watch`` is called with how many are done, ``collect`` with the portions in order: number (from
    0) of the first case, values (rows, n), and why they end. Where ``stopped``, the portions done
    are kept.
    """
    study = results.study
    source = study.source()
    block = -1
    draws: Draws = {}
    while results.done < results.requested and not stopped():
        first = results.done
        if first // BLOCK != block:
            block = first // BLOCK
            draws, again = source.block(block)
            results.redrawn += int(np.count_nonzero(again < results.requested - block * BLOCK))
        last = min(results.requested, first + PORTION, (block + 1) * BLOCK)
        part = some_of(draws, slice(first - block * BLOCK, last - block * BLOCK))
        cases = study.model.loops(part, np.arange(first, last), study.seed)
        try:
            flown = study.fly(cases, partial(_seen, watch, stopped, first))
        except _Interrupted:
            break
        values, severity = study.measured(flown)
        stops = [pilot.ending[0] for pilot in flown.pilots]
        results.take(values, severity, stops)
        if collect is not None:
            collect(first, values, stops)
        watch(results.done)
    return results


class _Interrupted(Exception):
    """A portion is left unfinished."""


def _seen(watch: Callable[[int], None], stopped: Callable[[], bool], first: int, over: int) -> None:
    watch(first + over)
    if stopped():
        raise _Interrupted

"""Worth of knowing more: what a plan leaves with other lengths of the coast, or after a probe pulse.

How well a longer record tells the spacecraft follows from the Cramér-Rao bound, before it is flown: the derivatives of
the same signals, as noisy and as often sampled, over a coast of that length. A plan from the estimate is then flown in
cases dispersed by that covariance and by what else the file disperses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from nutdamp.common import results
from nutdamp.common.numerics import finite
from nutdamp.errors import Infeasible
from nutdamp.estimation.fit import estimated
from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import (
    AXIS,
    CROSSING,
    DIRECTION,
    GYROS,
    QUATERNION,
    RATIO,
    SEEN,
    SUN_PULSE,
    Record,
    Vector,
)
from nutdamp.estimation.results import Carried, Estimate, carried, estimates, moving, posterior, replaced
from nutdamp.estimation.search import Fit, named_of
from nutdamp.montecarlo import study as dispersion
from nutdamp.montecarlo.cases import DispersedCases
from nutdamp.montecarlo.inputs import Draws
from nutdamp.montecarlo.propagated import ClosedForm, Ends
from nutdamp.montecarlo.statistics import VECTORS, Exact, vectors
from nutdamp.montecarlo.study import Results, Study, run
from nutdamp.physics import attitude
from nutdamp.planning import decision
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.requirements import Left
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

LENGTHS = (0.25, 0.5, 1.0, 2.0, 4.0)  # coasts that are looked at, over the one there is
CASES = 4000  # dispersed cases flown for each
NEAREST = 64  # cases nearest to a bound by which it is told how the closed form errs
DOUBTED = 4.0  # multiple of that error within which others are flown too
PAYS = 0.9  # share of that nutation, and less, down to which it must fall for another coast or a probe pulse to pay
MOST_SAMPLES = 20_000  # of a record that is looked at; longer ones are taken to be sampled less often, with less noise


@dataclass(frozen=True, eq=False)
class Prospect:
    """Prospect of knowing as much as after ``length`` s of coast."""

    length: float
    ratio: float  # sigma of C/A
    nutation: float  # rad, that `Outlook.probability` of the cases stay below
    met: float | None  # share of cases that meets the requirement, None without one
    probe: str = ""  # channel that fires a pulse of ``on_time`` s meanwhile, empty for none
    on_time: float = 0.0
    thrust: float = math.nan  # sigma of its thrust factor
    propellant: float | None = None  # kg of that pulse, None if unknown


@dataclass(frozen=True, eq=False)
class Outlook:
    """The prospects of coasts, from the shortest on, and of one probe pulse of each channel in the plan."""

    scheme: str
    coasts: tuple[Prospect, ...]
    probes: tuple[Prospect, ...]
    probability: float  # share of cases that must meet the requirement, and that stay below the nutation shown
    propellant: float | None  # kg of the plan, None if unknown

    @property
    def now(self) -> Prospect:
        """With a coast as long as the record."""
        return self.coasts[LENGTHS.index(1.0)]

    @property
    def enough(self) -> bool:
        """True where as many cases as must meet the requirement already: then nothing pays."""
        return self.now.met is not None and self.now.met >= self.probability

    @property
    def longer(self) -> Prospect | None:
        """The shortest longer coast that pays; None where none does."""
        longer = (prospect for prospect in self.coasts if prospect.length > self.now.length)
        return next(filter(self._pays, longer), None)

    @property
    def probe(self) -> Prospect | None:
        """The probe pulse that leaves least, where it pays."""
        return min(filter(self._pays, self.probes), key=lambda prospect: prospect.nutation, default=None)

    @property
    def thrifty(self) -> Prospect | None:
        """The probe pulse that lowers the nutation most per propellant, of those that pay; None if unknown."""
        rated = [prospect for prospect in self.probes if self._pays(prospect) and self.gain(prospect) is not None]
        return max(rated, key=lambda prospect: self.gain(prospect) or 0.0, default=None)

    def gain(self, prospect: Prospect) -> float | None:
        """Nutation, rad, by which a kg of a probe pulse lowers that of now; None where it takes no known propellant."""
        return (self.now.nutation - prospect.nutation) / prospect.propellant if prospect.propellant else None

    def _pays(self, prospect: Prospect) -> bool:
        return not self.enough and prospect.nutation < PAYS * self.now.nutation


def outlook(fitted: Fit, time: float, progress: Callable[[int], None] = lambda _: None) -> Outlook:
    """Prospects of a plan from ``time`` s on, by other records; raises Infeasible where there is none."""
    spacecraft = fitted.model.spacecraft
    now = carried(fitted, time)
    body = replaced(spacecraft, now)
    known = replace(body, dispersions=posterior(spacecraft.dispersions, now))
    plan = decision.compare(known).recommended
    if plan is None or not len(plan.pulses):
        raise Infeasible("no plan from the estimate has pulses: more telemetry would change nothing")
    probability = required_share(spacecraft.requirement)
    length, channels = fitted.model.record.length, {channel.name for channel in body.channels}
    looked_at = [(share * length, "", 0.0) for share in LENGTHS]
    # Of each channel that the plan fires, a pulse as long as its mean on-time.
    for name in dict.fromkeys(pulse.channel for pulse in plan.pulses):
        on_times = [pulse.on_time for pulse in plan.pulses if pulse.channel == name]
        if name in channels and min(on_times) > 0.0:
            looked_at.append((length, name, math.fsum(on_times) / len(on_times)))
    prospects = []
    for done, (length, probe, on_time) in enumerate(looked_at, start=1):
        imagined = _imagined(fitted, length, probe, on_time)
        then = carried(imagined, time - (fitted.model.record.end - length))
        dispersed = replace(plan.spacecraft, dispersions=posterior(spacecraft.dispersions, then))
        nutation, met = left_in_cases(dispersion.study_of(dispersed, plan.pulses), probability)
        sigmas = named_of(imagined.model, imagined.sigmas)
        thrust = sigmas.get(f"thrust {probe}", math.nan)
        propellant = imagined.model.record.schedule.propellant if probe else None
        prospects.append(Prospect(length, sigmas[RATIO], nutation, met, probe, on_time, thrust, propellant))
        progress(done)
    coasts, probes = tuple(prospects[: len(LENGTHS)]), tuple(prospects[len(LENGTHS) :])
    return Outlook(plan.scheme, coasts, probes, probability, plan.propellant)


def left_in_cases(study: Study, level: float) -> tuple[float, float | None]:
    """Nutation, rad, that the share ``level`` of the cases stays below, and the share that meets the requirement."""
    model, body = study.model, study.model.spacecraft
    alone = not (body.keep or body.tank or body.disturbances or model.schedule.blocks) and body.goal.spin is None
    if not (alone and body.inertia.symmetric):
        results = run(Results(study, CASES))
        nutations = results.distribution("nutation")
        assert nutations is not None
        return float(nutations.quantiles(np.array([level]))[0]), results.met_fraction
    # Only cases near one or the other by the closed form are flown.
    draws, closed = study.draws_of_all(np.arange(CASES)), ClosedForm(model)

    def ends(flies: Callable[[DispersedCases], Ends], drawn: Draws, count: int) -> Vector:
        return vectors(model, flies(model.cases(drawn)), count)

    def judged(there: Vector) -> Vector:
        """Nutation, rad, and severity, (2, n)."""
        nutation = np.arctan(np.hypot(there[0], there[1]))
        chord = np.linalg.norm(there[VECTORS[requirements.aim(body).value]], axis=0)
        aim = 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
        return np.stack([nutation, requirements.severity(body, Left(nutation, aim, body.spin))])

    # Where H ends the closed form errs by the widths of pulses: nearly alike in all cases.
    form = judged(ends(closed, draws, CASES) + ends(study.flies, {}, 1) - ends(closed, {}, 1))
    left, flown, bound = form.copy(), np.zeros(CASES, dtype=bool), np.ones(2)
    while True:
        bound[0] = Exact(left[0]).quantiles(np.array([level]))[0]
        off = np.abs(form - bound[:, None])
        error = DOUBTED * np.abs(left - form).max(axis=1) if flown.any() else np.sort(off)[:, :NEAREST].max(axis=1)
        near = np.flatnonzero(np.any(off <= error[:, None], axis=0) & ~flown)
        if not len(near):
            break
        drawn = {name: draw if isinstance(draw, float) else draw[near] for name, draw in draws.items()}
        left[:, near], flown[near] = judged(ends(study.flies, drawn, len(near))), True
    return float(bound[0]), float(np.mean(left[1] <= 1.0)) if requirements.judged(body) else None


def _imagined(fitted: Fit, length: float, probe: str, on_time: float) -> Fit:
    """The fit of a record of ``length`` s that ends when the record does, with t = 0 at its start; of noise alone."""
    model = fitted.model
    start = model.record.end - length
    then = Carried(start, (), np.empty(0), np.empty((0, 0)), *moving(fitted, start), None)
    body = replace(replaced(model.spacecraft, then), dispersions=model.spacecraft.dispersions)
    fired = Schedule()
    if probe:
        channel = next(channel for channel in body.channels if channel.name == probe)
        fired = Schedule((channel_pulse(channel, 0.5 * length, on_time),))
    interval = max(model.record.interval, length / MOST_SAMPLES)
    times = np.asarray(interval * np.arange(max(math.floor(length / interval), 8) + 1), dtype=np.float64)
    # Of three moments a growth takes integrations, which one that does not show is not worth.
    growing = fitted.grows if model.unequal else fitted.index("growth") is not None

    def of(record: Record) -> tuple[Model, dict[str, float]]:
        imagined = Model(body, record, unequal=model.unequal, growing=growing)
        values = {parameter.name: parameter.file for parameter in imagined.parameters}
        known = {name: value for name, value in fitted.named.items() if not name.startswith(("omega", "att"))}
        return imagined, values | {name: value for name, value in known.items() if name in values}

    sun = np.empty(0)
    if SUN_PULSE in model.signals:
        sun = np.arange(0.0, length, 2.0 * math.pi / abs(body.spin))
    if model.record.signals:
        still, values = of(Record(times, {GYROS[2]: np.zeros(len(times))}))
        samples = _samples(model, still.motion(values, times)[1])
    else:
        times, samples = np.empty(0), {}
    imagined, values = of(Record(times, samples, sun, model.record.sun_step, fired))
    thinned = math.sqrt(model.record.interval / interval)
    noise = np.array([fitted.noise[model.signals.index(name)] * thinned for name in imagined.signals])
    return estimated(imagined, np.array([values[parameter.name] for parameter in imagined.parameters]), noise)


def _samples(model: Model, quaternion: Vector) -> dict[str, Vector]:
    """Signals (n,) of a record of attitudes (n, 4), as often there as in the record of the model."""
    samples, count = dict[str, Vector](), len(quaternion)
    sense = model.spacecraft.sense
    axis = attitude.rotate(quaternion, sense * model.spacecraft.inertia.axes[:, 2])
    for kind in model.record.kinds:
        times, rows = kind.samples(model.record)
        there = np.diff(np.floor(np.arange(count + 1) * len(times) / len(model.record.times))) > 0.0
        table = {name: np.zeros(count) for name in kind.columns}
        if kind.name == CROSSING:
            ways = rows[np.arange(count) % len(rows), len(SEEN) :]
            seen = attitude.rotate(attitude.conjugate(quaternion), ways)
            table = dict(zip((*SEEN, *DIRECTION), np.column_stack([seen, ways]).T, strict=True))
        elif kind.columns in (AXIS, QUATERNION):
            table = dict(zip(kind.columns, (axis if kind.columns == AXIS else quaternion).T, strict=True))
        samples |= {name: np.where(there, values, math.nan) for name, values in table.items()}
    return samples


@dataclass(frozen=True, eq=False, repr=False)
class Fitted(results.Data, results.Drawn):
    """Spacecraft estimated from telemetry; ``core`` holds parameters, covariance, noise and residuals.

    ``warnings`` are those of reading the record.
    """

    core: Fit
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Fitted {self.core.model.spacecraft.name}: {len(self.core.named)} parameters>"

    def estimates(self, at: float = 0.0) -> tuple[Estimate, ...]:
        """Estimates with their sigmas; the motion is that at ``at`` s."""
        return estimates(self.core, at)

    def outlook(self, at: float = 0.0) -> Outlook:
        """Forecast of longer coasts and probe pulses for a plan from ``at`` s, as ``fit --next`` does."""
        return outlook(self.core, at)

    def text(self, at: float = 0.0) -> str:
        """Spacecraft file with the estimates in it and t = 0 at ``at`` s, as ``fit -o`` writes it.

        Raises BadRequest for a spacecraft that was not read from a file.
        """
        return str(results.view(self, "text", carried(self.core, at)))

    def spacecraft(self, at: float = 0.0) -> Spacecraft:
        """Spacecraft of that file."""
        body: Spacecraft = results.view(self, "spacecraft", self.text(at))
        return body

    def write(self, path: str | PathLike[str], at: float = 0.0) -> None:
        """Write `text` to a file, as ``fit -o`` does; raises BadRequest or CannotWrite."""
        results.view(self, "write", path, self.text(at))

    def to_dict(self, at: float = 0.0, ahead: Outlook | None = None) -> dict[str, Any]:
        """Contents of the file of ``fit --json``; with the forecast ``ahead``, that of ``fit --next --json``."""
        return finite(results.view(self, "data", carried(self.core, at), ahead, self.warnings))

"""Plans that meet a requirement with most cases, or with enough of them for the least propellant;
tolerance allocation.

`schemes.optimal.chance` gives burns that keep the requirement with a margin of so many sigmas, to
first order. They are made pulses, refined on the true motion and flown in dispersed cases; the
margin is adapted by what these show.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from nutdamp.common.work import SAMPLES
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.montecarlo.inputs import DispersedInput, mixing
from nutdamp.montecarlo.statistics import cases_to_show
from nutdamp.montecarlo.study import SEED, Results, Study, run, study_of, threads_here
from nutdamp.planning import plan as planning
from nutdamp.planning.plan import Plan
from nutdamp.schemes import planner, valve_commands
from nutdamp.schemes.catalogue import OPTIMAL, OptimalOptions, Options
from nutdamp.schemes.optimal.chance import ChanceLimit, ChanceProgram, Sure, Uncertain
from nutdamp.schemes.optimal.linear_program import SLOTS
from nutdamp.schemes.optimal.problem import Problem, as_pulses, broken_by
from nutdamp.schemes.optimal.refinement import EndEquations, Refinement, small_angles
from nutdamp.schemes.sequential import model_of
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Spacecraft, Vector, required_share
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.roles import as_known
from nutdamp.spacecraft.schedule import TOUCHING, Schedule, channel_pulse
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance

ROUNDING = 1e-9  # of a number of cases

MOST_TOLERANCES, ALLOCATION_HALVINGS = 4, 6
"""Tolerances that may have to shrink together, and halvings of the sizes between too few complying
cases and enough.
"""

CASES, MOST_CASES = (
    8_192,
    100_000,
)  # drawn cases in which each allocation is tried, and the most of one check

FRESH = 20_011
"""Seed of the first draws in which what was found is checked, which nothing was chosen by; each
check has its own.
"""

CHECKS, SMALLER = 12, 0.96  # checks at most, and by what the tolerances shrink after one that fails


@dataclass(frozen=True, slots=True)
class Tightening:
    """Inputs of the ``tolerances`` that are to be ``factor`` times as large; all others stay.

    ``inputs``: one of each size in the file, True for a share of the nominal value. Of ``cases``
    new ones of ``seed`` the share ``complied``; it is ``least`` at least, by the interval of 95 %.
    """

    tolerances: tuple[str, ...]
    factor: float
    inputs: tuple[tuple[DispersedInput, bool], ...]
    cases: int
    seed: int
    complied: float
    least: float


def tightening(plan: Plan, probability: float) -> Tightening | None:
    """Fewest dominant tolerances, and their reduction, for enough complying cases; None if none
    suffice.
    """
    spacecraft, given = plan.spacecraft, plan.spacecraft.dispersions
    if given is None or not requirements.required(spacecraft):
        return None
    study = study_of(spacecraft, plan.pulses)

    def tried(names: Iterable[str], factor: float, cases: int = CASES, seed: int = SEED) -> Results:
        changed = replace(spacecraft, dispersions=scaled(given, names, factor))
        return run(
            Results(study_of(changed, plan.pulses, seed=seed), cases), threads=threads_here()
        )

    def complying(names: Iterable[str], factor: float) -> bool:
        return (tried(names, factor).met_fraction or 0.0) >= probability

    shares: dict[str, float] = {}  # of the required bound, by tolerance
    parts = [
        bound.part.value
        for bound in requirements.required(spacecraft)
        if bound.part is not Part.SPIN
    ]
    for output in parts or ["spin_change"]:
        for entry, share in zip(
            study.first_order.inputs, study.first_order.shares(output).tolist(), strict=True
        ):
            shares[entry.tolerance] = max(shares.get(entry.tolerance, 0.0), share)
    ranked = [
        name for name in sorted(shares, key=lambda name: -shares[name]) if hasattr(given, name)
    ]
    fresh = (
        min(max(SAMPLES, 2 * cases_to_show(probability)), MOST_CASES)
        if probability < 1.0
        else SAMPLES
    )
    for count in range(1, min(len(ranked), MOST_TOLERANCES) + 1):
        names = tuple(ranked[:count])
        if not complying(names, 0.0):
            continue
        low, high = 0.0, 1.0
        for _ in range(ALLOCATION_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if complying(names, middle) else (low, middle)
        # The tries all had the same draws, and the largest size that passes passes by luck too.
        for seed in range(FRESH, FRESH + CHECKS):
            trial = tried(names, low, fresh, seed)
            if trial.shown():
                share = trial.met_fraction or 0.0
                least = trial.interval()[0]
                return Tightening(
                    names, low, _stated(study, given, names), fresh, seed, share, least
                )
            low *= SMALLER
    return None


def _stated(
    study: Study, given: Dispersions, names: Iterable[str]
) -> tuple[tuple[DispersedInput, bool], ...]:
    """Input of each size of the named tolerances, with a flag for relative sizes."""
    sizes: dict[tuple[str, str, float], tuple[DispersedInput, bool]] = {}
    for name in names:
        for entry in study.model.inputs.drawn:
            if entry.tolerance == name and entry.kind != "bias":
                sizes.setdefault(
                    (name, entry.kind, entry.size), (entry, _relative(getattr(given, name), entry))
                )
    return tuple(sizes.values())


def _relative(value: Any, entry: DispersedInput) -> bool:
    """True if the size of an input is given as a share of its nominal value."""
    if isinstance(value, Tolerance):
        return value.relative
    if isinstance(value, Mapping):
        return any(size.relative for name, size in value.items() if name in entry.name.split())
    tolerance = value[int(entry.name.rpartition("_")[2]) - 1]
    return tolerance is not None and tolerance.relative


def scaled(given: Dispersions, names: Iterable[str], factor: float) -> Dispersions:
    """Dispersions of which those of some names are ``factor`` times as large;
    fixed offsets stay.
    """
    return replace(given, **{name: _scaled(getattr(given, name), factor) for name in names})


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, Tolerance):
        return value if value.kind == "bias" else replace(value, size=factor * value.size)
    if isinstance(value, Mapping):
        return {name: _scaled(item, factor) for name, item in value.items()}
    return None if value is None else tuple(_scaled(item, factor) for item in value)


STEP = 1e-30  # imaginary step of derivatives

MARGINS, LESSER = (1.0, 1.3, 0.75, 0.5), (1.0, 0.8, 0.6)
"""Over the sigmas of the probability required: margins that are tried first, until enough cases
comply; and multiples of the largest feasible margin, where that is not enough.
"""

CLOSE = 0.983, 0.998
"""Severities of the last case that must comply with a margin that is no larger than need be, nor by
luck.
"""

KEPT, HALVINGS = 1e-2, 6  # tolerance of a limit in that search, and its number of steps
TRIED, TRYING = (
    4_096,
    101,
)  # cases in which a plan is tried while its margin is adapted, and their seed
ROUNDS, REPAIRS = (
    4,
    24,
)  # times that the margin is adapted, and that a burn which breaks a limit is moved elsewhere

TRIES, AIMED, NEAREST, FACTOR, STEEP = 4, 0.99, 0.1, 0.8, 0.15
"""Margins tried once enough cases comply with one; the level aimed at; how near the next one comes
to those before, of their distance; and where no lower one is known, its least share of the least
one, and the fall of the level by a sigma of margin.
"""

STRAIGHT, TURNS = 0.3, 2.5
"""rad by which one sigma may turn what a pulse does: for later pulses first order is no good;
nutation periods that are looked at in any case.
"""

MOST_BURNS, LARGEST = 8, 60_000
"""Burns that are kept, the longest: the program has very short ones besides; slots up to which a
plan is sought.
"""


def uncertain(spacecraft: Spacecraft, on_times: Vector, goal: Vector, stretch: Vector) -> Uncertain:
    """First-order effect of dispersions on pulses of ``on_times`` (K,) s, per second of them, by
    complex steps.

    The ``stretch`` (2,) of the torques of a `SymmetricModel` counts for the nutation, not for H.
    """
    pulses = [
        channel_pulse(channel, 100.0 + 1e3 * at, on)
        for at, (channel, on) in enumerate(zip(spacecraft.channels, on_times, strict=True))
    ]
    model = DispersedModel(spacecraft, Schedule(tuple(pulses)))
    drawn = [entry for entry in model.inputs.drawn if entry.kind != "bias"]
    biases = (entry for entry in model.inputs.drawn if entry.kind == "bias")
    draws = {entry.name: np.full(len(drawn) + 1, entry.size, dtype=complex) for entry in biases}
    for at, entry in enumerate(drawn):
        draws[entry.name] = np.zeros(len(drawn) + 1, dtype=complex)
        draws[entry.name][at] = 1j * STEP * entry.sigma
    cases = model.cases(draws)

    def parts(value: object) -> tuple[float, Vector]:
        """Value and derivatives by one sigma."""
        whole = np.broadcast_to(np.asarray(value, dtype=complex), len(drawn) + 1)
        return float(whole[-1].real), np.asarray(whole[:-1].imag / STEP)

    (A, dA), (C, dC), (wheel, dwheel) = parts(cases.A), parts(cases.C), parts(cases.wheel)
    rates = [parts(component) for component in cases.omega0]
    spin, dspin = rates[2]
    a = 1.0 - C / A
    da = C / A**2 * dA - dC / A
    axial, daxial = C * spin + wheel, dC * spin + C * dspin + dwheel
    dnutation = a * dspin + da * spin - dwheel / A + wheel / A**2 * dA
    start = A * (rates[0][1] + 1j * rates[1][1]) + dA * complex(rates[0][0], rates[1][0])
    tilt = parts(cases.tilt[0])[1], parts(cases.tilt[1])[1]
    pointed = (
        start + axial * (tilt[1] - 1j * tilt[0])
        if spacecraft.goal.axis is not None
        else np.zeros(len(drawn))
    )
    impulses = [[parts(part) for part in impulse] for impulse in cases.impulses]
    on = np.asarray(on_times)
    nominal = np.array([[value for value, _ in impulse] for impulse in impulses])
    changes = np.array([[change for _, change in impulse] for impulse in impulses])
    begun = [parts(start) for start in cases.starts]
    mixed = mixing(drawn, model.groups)
    effect = np.asarray((nominal[:, 0] + 1j * nominal[:, 1]) / on, dtype=np.complex128)
    torque = (changes[:, 0] + 1j * changes[:, 1]) / on[:, None] @ mixed
    late, less = np.array([change for _, change in begun]) @ mixed, daxial / axial @ mixed
    before = np.array([start, pointed]) @ mixed
    to_do = goal[:4:2] + 1j * goal[1:4:2]
    in_space = effect.real / stretch[0] + 1j * effect.imag / stretch[1]
    turning = torque.real / stretch[0] + 1j * torque.imag / stretch[1]
    each = (torque, effect, spacecraft.nutation_rate), (turning, in_space, spacecraft.spin)
    turned = [one + (1j * pace * late - less) * whole[:, None] for one, whole, pace in each]
    return Uncertain(
        effects=np.array([effect, in_space, nominal[:, 2] / on]),
        changes=np.array([*turned, changes[:, 2] / on[:, None] @ mixed]),
        rates=np.array([*(np.array([dnutation, dspin]) @ mixed), np.zeros(len(drawn))]),
        start=np.array([*(before + less * to_do[:, None]), C * dspin @ mixed]),
        own=np.array([" pulse " in entry.name for entry in drawn], dtype=bool),
        delay=np.array(
            [value - pulse.start for (value, _), pulse in zip(begun, pulses, strict=True)]
        ),
        goal=np.array([*to_do, goal[4]]),
    )


def plans(spacecraft: Spacecraft, options: Options | None = None) -> Iterator[tuple[str, Plan]]:
    """Plans that keep the requirement with margins, each with a label; none where nothing is
    required.
    """
    known = as_known(
        spacecraft, disturbed=planner.settled(OPTIMAL, options, spacecraft).with_disturbances
    )
    if (
        not requirements.required(spacecraft)
        or not spacecraft.channels
        or known.dispersions is None
    ):
        return
    try:
        search = _MarginSearch(spacecraft, known)
    except Infeasible:
        return
    yield from search.plans()


def level(results: Results) -> float:
    """Severity of the last case that must comply: 1 or less where enough do,
    as far as it is known.
    """
    last = int((1.0 - results.probability) * results.done + ROUNDING)
    severities = results.worst.severities
    if results.study.model.spacecraft.keep or last >= len(severities):
        return 1.0 if (results.met_fraction or 0.0) >= results.probability else math.inf
    return float(severities[last])


class _MarginSearch:
    """Search for one spacecraft."""

    def __init__(self, spacecraft: Spacecraft, as_known: Spacecraft) -> None:
        self.spacecraft, self.as_known = spacecraft, as_known
        self.without_valves = (
            valve_commands.without_valves(as_known) if as_known.thrust_laws else as_known
        )
        self.model = model_of(self.without_valves)
        parts = {bound.part: bound.limit for bound in requirements.required(spacecraft)}
        aim = requirements.aim(spacecraft)
        aimed = aim in parts or as_known.goal.axis is not None
        self.equations = EndEquations(shift=aimed, spin=as_known.goal.spin is not None)
        self.options = OptimalOptions(free_axis=not aimed)
        self.program = Problem(self.model.symmetric, self.options).program()
        if self.program.forbidden.size > LARGEST:
            raise Infeasible("too many slots")
        flat = self.model.symmetric
        axial = abs(flat.inertia.axial(flat.spin if flat.goal.spin is None else flat.goal.spin))
        limits = []
        if Part.NUTATION in parts:
            limits.append(ChanceLimit(0, axial * math.tan(min(parts[Part.NUTATION], 1.4))))
        if aim in parts:
            limits.append(ChanceLimit(1, axial * math.sin(min(parts[aim], 1.5))))
        if Part.SPIN in parts:
            limits.append(ChanceLimit(2, flat.inertia.C * parts[Part.SPIN]))
        self.limits = tuple(limits)
        longest = max((burn.on_time for burn in self.program.solve().burns), default=0.1)
        channels = self.program.channels
        ons = np.array(
            [
                min(max(longest, channel.min_on_time, 1e-3), channel.max_on_time)
                for channel in channels
            ]
        )
        flat = replace(flat, channels=channels, dispersions=as_known.dispersions)
        every = EndEquations(True, True)
        goal = np.zeros(5)
        goal[every.chosen] = small_angles(flat, every).goal
        dispersed = uncertain(flat, ons, goal, self.model.stretch)
        drift = float(np.linalg.norm(dispersed.rates, axis=1).max())
        last = max(
            STRAIGHT / max(drift, 1e-12), flat.limits.earliest + TURNS * flat.nutation_period
        )
        self.program.forbid(None, last, math.inf)
        self.chance = ChanceProgram(
            self.program, dispersed, self.limits, float(np.linalg.norm(goal))
        )
        # Within so many of a plane normal distribution the required share lies.
        self.sigmas = math.sqrt(
            -2.0 * math.log(max(1.0 - required_share(spacecraft.requirement), 1e-9))
        )

    def plans(self) -> Iterator[tuple[str, Plan]]:
        """Plans by margins between which the least lies with which enough cases comply, or the most
        cases do.
        """
        seen: dict[float, tuple[float, float]] = {}
        first = self._first()
        closer = 0
        while closer < TRIES:
            if any(requirements.complies(level) for _, level in seen.values()):
                margin = self._between(seen)
                closer = closer + 1
            elif len(seen) < len(first) + ROUNDS:
                margin = first[len(seen)] if len(seen) < len(first) else self._next(seen)
            else:
                return
            seen[margin] = 0.0, math.inf
            schedule = self.schedule(margin)
            plan = (
                None
                if schedule is None
                else planning.judged(self.spacecraft, OPTIMAL.name, schedule, self.options)
            )
            if plan is not None and plan.feasible and keeps_limits(self.spacecraft, plan.pulses):
                trial = Results(study_of(self.spacecraft, plan.pulses, seed=TRYING), TRIED)
                results = run(trial, threads=threads_here())
                seen[margin] = results.met_fraction or 0.0, level(results)
                yield f"against dispersions, {margin:.3g} σ", plan
            if CLOSE[0] <= seen[margin][1] <= CLOSE[1]:
                return

    def _first(self) -> list[float]:
        """First margins: about that of the probability, or up to the largest that can be kept."""
        chance = self.chance
        low = 0.0
        high = max(MARGINS) * self.sigmas
        if chance.solve(high).excess <= KEPT:
            return [factor * self.sigmas for factor in MARGINS]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if chance.solve(middle).excess <= KEPT else (low, middle)
        return [self.sigmas, *(factor * low for factor in LESSER if low > 0.0)]

    def _between(self, seen: dict[float, tuple[float, float]]) -> float:
        """Margin towards the least with which enough cases comply, by the levels beside it."""
        least = min(margin for margin, (_, level) in seen.items() if requirements.complies(level))
        most = max((margin for margin in seen if margin < least), default=0.0)
        over = seen[most][1] if most else math.inf
        under = seen[least][1]
        if math.isinf(over):
            return max(FACTOR * least, 0.5 * (most + least), least - (AIMED - under) / STEEP)
        share = min(max((over - AIMED) / (over - under), NEAREST), 1.0 - NEAREST)
        return most + share * (least - most)

    def _next(self, seen: dict[float, tuple[float, float]]) -> float:
        """Another margin, beside the one with which most cases comply."""
        best = max(seen, key=lambda margin: seen[margin][0])
        below = max((margin for margin in seen if margin < best), default=0.5 * best)
        above = min((margin for margin in seen if margin > best), default=1.5 * best)
        return 0.5 * (best + (below if best - below > above - best else above))

    def _parted(self, solution: Sure) -> bool:
        """Separate burns that overlap or are too near, at the middle; True if there were any."""
        program = self.program
        gap = self.program.spacecraft.limits.gap
        parted = False
        for earlier, later in itertools.pairwise(solution.burns):
            end = earlier.t + 0.5 * earlier.on_time
            begin = later.t - 0.5 * later.on_time
            if begin >= end + gap - TOUCHING or earlier.channel is later.channel:
                continue
            middle = min(max(0.5 * (begin + end), earlier.t), later.t)
            aside = 0.5 * (gap + program.width)
            half = 0.5 * later.on_time + program.width
            before = program.forbidden.copy()
            program.forbid(
                earlier.channel, middle - aside, max(later.t + half, end + program.width)
            )
            program.forbid(
                later.channel,
                min(earlier.t - 0.5 * earlier.on_time, begin) - program.width,
                middle + aside,
            )
            parted = parted or bool((before != program.forbidden).any())
        return parted

    def schedule(self, margin: float) -> Schedule | None:
        """Schedule of a margin, refined on the true motion;
        None where its burns cannot be fired.
        """
        program, chance = self.program, self.chance
        allowed = program.forbidden.copy()
        try:
            near = np.zeros_like(
                allowed
            )  # slots about the longest burns, the only ones from here on
            for burn in sorted(chance.solve(margin).burns, key=lambda burn: -burn.impulse)[
                :MOST_BURNS
            ]:
                reach = 0.5 * burn.on_time + SLOTS // 8 * program.width
                near[
                    program.channels.index(burn.channel), np.abs(program.centres - burn.t) < reach
                ] = True
            program.forbidden |= ~near
            for _ in range(REPAIRS):
                solution = chance.solve(margin)
                if not solution.burns:
                    return None
                if self._parted(solution):
                    continue
                broken = broken_by(program, solution.burns)
                if broken is None:
                    break
                program.forbid(*broken)
            else:
                return None
        finally:
            program.forbidden = allowed
        schedule = self.model.translate(as_pulses(self.model.symmetric, solution.burns))
        aside = solution.left[self.equations.chosen]
        fly = partial(propagation.flown, self.without_valves)
        schedule = Refinement(fly(schedule), self.equations, aside, fly).refined()
        if not self.as_known.thrust_laws:
            return schedule
        try:
            return planner.as_commands(OPTIMAL.name, self.as_known, schedule, self.options)
        except Infeasible:
            return None

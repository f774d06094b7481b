"""Propellant and pulses a year that hold the nutation against energy dissipation, and how long the tank lasts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from nutdamp.common import results
from nutdamp.control_loop.limit_cycle import Cycle, Map
from nutdamp.control_loop.stability import Band, dead_band, feeding, margins, too_late
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Loop
from nutdamp.spacecraft.model import Spacecraft

DAY = 86400.0
YEAR = 365.25 * DAY
"""s."""

NOISY, WIDENED = 0.1, 0.2
"""Noise of estimates (one sigma), over the start threshold, above which the map underestimates firings, and the
share by which their number is then known at best: flown loops fire up to a fifth more at 0.2 of start."""

DIFFERENT = 0.3
"""Relative difference of pulses by which one limit cycle differs from another."""

STAGES = tuple((part / 8.0, weight / 24.0) for part, weight in enumerate((1, 4, 2, 4, 2, 4, 2, 4, 1)))
"""Shares of the propellant used at which a rate of use is worked out, with the weights of Simpson's rule.

So many, as the rate is uneven: how well the last pulse of a cycle fits differs with the thrust."""


class Thresholds(NamedTuple):
    """Nutation, rad, from which a loop fires, and down to which."""

    start: float
    stop: float


@dataclass(frozen=True, eq=False)
class HeldNutation:
    """Nutation held between ``thresholds``: the limit ``cycle`` at the present spin; ``why`` there is none.

    It is the one that the loop falls into from the nutation of the file; ``other`` is a second one, None without.
    ``noisy``: its noise is above `NOISY` of start.

    ``begins`` s is when the loop first fires, ``band`` what the sensor and the smallest pulse allow, ``lasts`` s how
    long the propellant in the tank is enough for the limit cycle, None where that is not known.
    """

    spacecraft: Spacecraft
    thresholds: Thresholds
    begins: float
    band: Band | None = None
    cycle: Cycle | None = None
    other: Cycle | None = None
    lasts: float | None = None
    noisy: bool = False
    why: str = ""

    @property
    def meets_requirement(self) -> bool | None:
        """True if the nutation stays within the requirement; None without one, False without a limit cycle."""
        required = self.spacecraft.requirement
        if required is None or required.nutation is None:
            return None
        return self.cycle is not None and self.cycle.largest <= required.nutation

    @property
    def slows(self) -> float | None:
        """Relative change of the spin in a year of the cycle, at the present rate; signed. None without spin."""
        spin = self.spacecraft.spin
        return None if self.cycle is None or spin == 0.0 else self.cycle.spin_rate * YEAR / spin


@dataclass(frozen=True, eq=False, repr=False)
class Budget(results.Data, results.Written):
    """Growth of nutation in a ``spacecraft``, and the cost of holding it, for each pair of thresholds in ``held``.

    ``largest``: θ_max, rad, of which `until_largest` tells when it is reached; None where none is named.
    """

    spacecraft: Spacecraft
    largest: float | None
    held: tuple[HeldNutation, ...]

    def __repr__(self) -> str:
        return f"<Budget of {self.spacecraft.name}, pairs of thresholds: {len(self.held)}>"

    @property
    def until_largest(self) -> float | None:
        """Time, s, after which damping must have begun; see `compliance.reached`."""
        return None if self.largest is None else requirements.reached(self.spacecraft, self.largest)

    @property
    def feasible(self) -> bool:
        """True if some pair of thresholds has a limit cycle, or none is needed."""
        return not self.held or any(pair.cycle is not None for pair in self.held)

    @property
    def meets_requirement(self) -> bool | None:
        """True if some pair of thresholds meets the requirement; None where nothing is required of a loop."""
        meets = [pair.meets_requirement for pair in self.held]
        return None if not meets or None in meets else any(meets)


def expect_dissipation(spacecraft: Spacecraft) -> None:
    """Raise BadRequest, with the keys to add, for a spacecraft whose nutation neither grows nor decays."""
    if spacecraft.dissipation is None:
        raise BadRequest(
            "the spacecraft file has no dissipation: it does not say how fast the nutation grows. For example:\n\n"
            "dissipation: {time_constant: 600 s}"
        )


def budget(
    spacecraft: Spacecraft,
    pairs: Sequence[Thresholds] = (),
    largest: float | None = None,
    *,
    seed: int = 1,
    progress: Callable[[int], None] = lambda _: None,
) -> Budget:
    """Budget of a ``spacecraft`` with dissipation, for ``pairs`` of thresholds, default those of its loop.

    ``largest`` rad: θ_max, default the nutation required. Nothing is held where the nutation does not grow, or the file
    has no loop. ``progress`` is called with the number of pairs done.
    """
    expect_dissipation(spacecraft)
    required = spacecraft.requirement
    if largest is None and required is not None:
        largest = required.nutation
    loop = spacecraft.loop
    if loop is None or spacecraft.growth <= 0.0:
        return Budget(spacecraft, largest, ())
    held = []
    for done, pair in enumerate(pairs or [Thresholds(loop.start, loop.stop)], start=1):
        held.append(_held(spacecraft, replace(loop, start=pair.start, stop=pair.stop), seed))
        progress(done)
    return Budget(spacecraft, largest, tuple(held))


def _held(spacecraft: Spacecraft, loop: Loop, seed: int) -> HeldNutation:
    body = replace(spacecraft, loop=loop)
    pair = Thresholds(loop.start, loop.stop)
    result = HeldNutation(body, pair, requirements.reached(body, loop.start))
    try:
        result = replace(result, band=dead_band(body, loop))
        _expect_damping(body, loop)
        cycles = Map(body, loop, seed=seed)
        cycle, *others = _attractors(body, loop, cycles)
        if cycles.seen.sigma > NOISY * cycles.start:
            result, cycle = replace(result, noisy=True), cycle._replace(doubt=max(cycle.doubt, WIDENED))
        result = replace(result, cycle=cycle, other=others[0] if others else None)
        return replace(result, lasts=_lasts(body, loop, seed))
    except Infeasible as reason:
        return replace(result, why=str(reason))


def _attractors(body: Spacecraft, loop: Loop, cycles: Map) -> list[Cycle]:
    """Limit cycle of the loop from the nutation of the file, and others that differ from it.

    There may be others where a firing can leave more than the stop threshold that no smaller pulse lowers.
    """
    band, law = dead_band(body, loop), cycles.law
    if not 0.5 * band.step > loop.stop > 0.0:
        return [cycles.cycle()]
    now = complex(law.seen(body.initial.omega))
    starts = [now] * (body.nutation >= loop.start) + [None, complex(law.size(0.5 * band.step, body.spin))]
    distinct: list[Cycle] = []
    for z in starts:
        for cycle in cycles.attractors(z=z):
            if all(abs(cycle.pulses - each.pulses) > DIFFERENT * each.pulses for each in distinct):
                distinct.append(cycle)
    return distinct


def _expect_damping(body: Spacecraft, loop: Loop) -> None:
    """Raise Infeasible where firings feed the nutation: by faults in the file, or by their delay."""
    turned = [margin.channel for margin in margins(body, loop) if margin.cause.turned]
    if turned:
        raise Infeasible(f"firings of {' and '.join(turned)} feed the nutation: wired backwards against the sensor")
    late = feeding(body, loop)
    if late is not None:
        raise Infeasible(too_late(late))


def _lasts(body: Spacecraft, loop: Loop, seed: int) -> float | None:
    """Lifetime of the limit cycle, s: ∫ dm over the flow, as the pressure in the tank falls."""
    if body.tank is None:
        return None
    mass, total = body.tank.propellant, 0.0
    for share, weight in STAGES:
        rate = _attractors(body, loop, Map(body, loop, used=share * mass, seed=seed))[0].propellant
        if rate is None:
            return None
        total += weight / rate
    return float(mass * total)

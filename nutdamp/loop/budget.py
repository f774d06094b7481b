"""What it takes to hold the nutation against energy dissipation: pulses a day, propellant a year, how long it lasts.

tan θ = tan θ0 e^{κt} says when damping must begin; the limit cycle of a closed loop (`cycles.Map`) what follows then.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from nutdamp import compliance
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.loop.chains import Cycle
from nutdamp.loop.cycles import Map
from nutdamp.loop.stability import Band, dead_band, feeding, margins, too_late
from nutdamp.loop_settings import Loop
from nutdamp.spacecraft import Spacecraft

DAY = 86400.0
YEAR = 365.25 * DAY
"""s."""

NOISY, WIDENED = 0.1, 0.2
"""Noise of what is seen (one sigma), over the start threshold, above which firings are more than the map has, and the
share by which their number is then known at best: flown loops fire up to a fifth more at 0.2 of start."""

DIFFERENT = 0.3
"""Share of the pulses by which one limit cycle differs from another."""

STAGES = tuple((part / 8.0, weight / 24.0) for part, weight in enumerate((1, 4, 2, 4, 2, 4, 2, 4, 1)))
"""Shares of the propellant used at which a rate of use is worked out, with the weights of Simpson's rule.

So many, as the rate is uneven: how well the last pulse of a cycle fits differs with the thrust."""


class Thresholds(NamedTuple):
    """Nutation, rad, from which a loop fires, and down to which."""

    start: float
    stop: float


@dataclass(frozen=True, eq=False)
class Held:
    """The nutation held between ``thresholds``: the limit ``cycle`` at the present spin; ``why`` there is none.

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
        """Whether the nutation stays within what is required; None where nothing is, False without a limit cycle."""
        required = self.spacecraft.requirement
        if required is None or required.nutation is None:
            return None
        return self.cycle is not None and self.cycle.largest <= required.nutation

    @property
    def slows(self) -> float | None:
        """Share of its spin by which a year of this changes it, at the present rate; signed."""
        return None if self.cycle is None else self.cycle.spin_rate * YEAR / self.spacecraft.spin


@dataclass(frozen=True, eq=False)
class Budget:
    """How nutation grows in a ``spacecraft``, and what it takes to hold it, for each pair of thresholds in ``held``.

    ``largest``: θ_max, rad, of which `until_largest` tells when it is reached; None where none is named.
    """

    spacecraft: Spacecraft
    largest: float | None
    held: tuple[Held, ...]

    @property
    def until_largest(self) -> float | None:
        """Time, s, after which damping must have begun; see `compliance.reached`."""
        return None if self.largest is None else compliance.reached(self.spacecraft, self.largest)

    @property
    def feasible(self) -> bool:
        """Whether some pair of thresholds has a limit cycle, or none is needed."""
        return not self.held or any(one.cycle is not None for one in self.held)

    @property
    def meets_requirement(self) -> bool | None:
        """Whether some pair of thresholds meets it; None where nothing is required of a loop."""
        found = [one.meets_requirement for one in self.held]
        return None if not found or None in found else any(found)


def expect_dissipation(spacecraft: Spacecraft) -> None:
    """Raises BadRequest, which shows what to write, for a spacecraft whose nutation neither grows nor decays."""
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
    """The budget of a ``spacecraft`` with dissipation, for ``pairs`` of thresholds, default those of its loop.

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


def _held(spacecraft: Spacecraft, loop: Loop, seed: int) -> Held:
    body = replace(spacecraft, loop=loop)
    pair = Thresholds(loop.start, loop.stop)
    found = Held(body, pair, compliance.reached(body, loop.start))
    try:
        found = replace(found, band=dead_band(body, loop))
        _expect_damping(body, loop)
        made = Map(body, loop, seed=seed)
        cycle, *others = _attractors(body, loop, made)
        if made.seen.sigma > NOISY * made.start:
            found, cycle = replace(found, noisy=True), cycle._replace(doubt=max(cycle.doubt, WIDENED))
        found = replace(found, cycle=cycle, other=others[0] if others else None)
        return replace(found, lasts=_lasts(body, loop, seed))
    except Infeasible as reason:
        return replace(found, why=str(reason))


def _attractors(body: Spacecraft, loop: Loop, made: Map) -> list[Cycle]:
    """The limit cycle that the loop falls into from the nutation of the file, and others that differ from it.

    There may be others where a firing can leave more than the stop threshold that no smaller pulse lowers.
    """
    band, law = dead_band(body, loop), made.law
    if not 0.5 * band.step > loop.stop > 0.0:
        return [made.cycle()]
    now = complex(law.seen(body.initial.omega))
    starts = [now] * (body.nutation >= loop.start) + [None, complex(law.size(0.5 * band.step, body.spin))]
    found: list[Cycle] = []
    for z in starts:
        for one in made.attractors(z=z):
            if all(abs(one.pulses - each.pulses) > DIFFERENT * each.pulses for each in found):
                found.append(one)
    return found


def _expect_damping(body: Spacecraft, loop: Loop) -> None:
    """Raises Infeasible where firings feed the nutation: by faults in the file, or by how late they come."""
    turned = [one.channel for one in margins(body, loop) if one.cause.turned]
    if turned:
        raise Infeasible(f"firings of {' and '.join(turned)} feed the nutation: wired backwards against the sensor")
    late = feeding(body, loop)
    if late is not None:
        raise Infeasible(too_late(late))


def _lasts(body: Spacecraft, loop: Loop, seed: int) -> float | None:
    """How long the limit cycle can go on, s: ∫ dm over what it uses a second, as the pressure in the tank falls."""
    if body.tank is None:
        return None
    mass, total = body.tank.propellant, 0.0
    for share, weight in STAGES:
        rate = _attractors(body, loop, Map(body, loop, used=share * mass, seed=seed))[0].propellant
        if rate is None:
            return None
        total += weight / rate
    return float(mass * total)

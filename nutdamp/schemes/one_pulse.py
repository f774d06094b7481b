"""One pulse of A|ω| against ω, Magnus 1970 (21): the nutation goes, H moves to the spin axis, by θ0."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from nutdamp.common import work
from nutdamp.errors import Infeasible, TooShort
from nutdamp.physics import response
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.schemes.correction import FlownBuilder
from nutdamp.schemes.sequential import ImpulseBuilder, at_hand, no_alignment
from nutdamp.spacecraft.constraints import longest_useful, usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule

TRAIN_SHARE = 0.25  # longest pulse of a train, as a share of T_ω: it loses 10 % of its impulse to its width

PREDAMPING_INTEGRATED = 20_000  # steps of integration after which no more of them are tried
IN_REACH = 0.5  # share of the horizon within which the damping begins: the rest is for the turn

LEFT_OVER = 0.01  # share of A|ω0| from which a remainder counts against a channel


def schedule(spacecraft: Spacecraft, options: SchemeOptions) -> Schedule:  # noqa: ARG001 - the signature of a scheme
    """One pulse, or a train of equal ones where on-times are too short or the torque too weak for one.

    A steerable torquer fires at once. A body-fixed channel waits until it opposes ω; the channel that needs
    the fewest pulses, then the least propellant (impulse where unknown), then ends first, is taken.
    """
    torquer = spacecraft.torquer
    if torquer is not None:
        torque = math.inf if torquer.torque is None else torquer.torque
        builder = _train(spacecraft, torque, 0.0, math.inf, lambda builder, impulse: builder.steer(torquer, impulse))
        if builder.pulses:
            return builder.schedule()
        raise TooShort(f"no pulse of the steerable torquer fits before the horizon of {spacecraft.horizon:.4g} s")
    channels = at_hand(spacecraft, usable(spacecraft))
    trains = [builder for builder in (_fixed(spacecraft, channel) for channel in channels) if builder.pulses]
    if not trains:
        raise no_alignment(spacecraft, channels)
    lacking = LEFT_OVER * spacecraft.least_impulse
    choices = [(not train.settled and train.left > lacking, train.schedule()) for train in trains]
    return min(choices, key=lambda choice: (choice[0], len(choice[1]), choice[1].cost, choice[1].end))[1]


def _fixed(spacecraft: Spacecraft, channel: Channel) -> ImpulseBuilder:
    """Pulses of one channel at its successive alignments."""

    def fire(builder: ImpulseBuilder, impulse: float) -> Pulse | None:
        on_time = builder.on_time_for(channel, impulse)
        longest = longest_useful(channel.max_on_time, builder.period)
        return builder.align(channel, longest if on_time is None else on_time)

    slope = spacecraft.inertia.a * channel.axial / spacecraft.inertia.C
    return _train(spacecraft, abs(channel.transverse), slope, channel.max_on_time, fire)


def _train(
    spacecraft: Spacecraft,
    torque: float,
    slope: float,
    max_on_time: float,
    fire: Callable[[ImpulseBuilder, float], Pulse | None],
) -> ImpulseBuilder:
    """The fewest equal pulses that take out what is left; fewer where the limits end it or nothing is gained."""
    start = ImpulseBuilder(spacecraft)

    def capacity(on_time: float) -> float:
        if math.isinf(torque) or math.isinf(on_time):
            return math.inf
        return torque * on_time * abs(response.width_factor(start.turning, slope, on_time))

    longest, most, count = longest_useful(max_on_time, start.period), start.most, 1
    single = math.isinf(torque) or response.on_time_for(start.left, torque, start.turning, slope, longest)
    share = capacity(min(max_on_time, TRAIN_SHARE * start.period))
    if not single and share > 0.0:
        count = math.ceil(min(start.left / share, most + 1.0))
        if count > most:  # rather longer pulses than too many
            count = max(math.ceil(min(start.left / max(capacity(longest), share), most)), 1)
    # A channel that also spins up takes out less the longer it is on: one pulse may do what the longest cannot.
    strongest = math.inf if single else capacity(longest)
    builder = _fire_train(spacecraft, count, strongest, fire)
    if spacecraft.growth > 0.0 and builder.pulses and builder.left > LEFT_OVER * start.left:
        # The nutation grows while the train waits for its moments: a pulse more than it takes now.
        longer = _fire_train(spacecraft, count + 1, strongest, fire)
        builder = min(builder, longer, key=lambda train: train.left)
    return builder


def _fire_train(
    spacecraft: Spacecraft, count: int, strongest: float, fire: Callable[[ImpulseBuilder, float], Pulse | None]
) -> ImpulseBuilder:
    builder = ImpulseBuilder(spacecraft)
    for remaining in range(count, 0, -1):
        pulse = fire(builder, min(builder.left / remaining, strongest))
        if builder.full or pulse is None or not builder.helps(pulse):
            break
        builder.fire(pulse)
    return builder


def damped(start: FlownBuilder) -> FlownBuilder:
    """The ``start``, after the damping by one pulse or a train, from which the rest of the way costs least.

    H then goes to the momentary spin axis. Its pulses cost A|ω0| whenever they come, but the turn that is left,
    C|ω3| times its angle, differs by the cone.
    Raises Infeasible where no channel can damp, or where the budget ends while the damping is flown.
    """
    here = start.here
    h = abs(here.axial)
    # A torquer can fire at any point of the cone; channels at their alignments, which come by the body period.
    span = here.inertial_period if here.torquer is not None else 4.0 * min(here.body_period, 0.1 * here.horizon)
    best: tuple[float, FlownBuilder] | None = None
    reason: Infeasible | None = None
    steps = 0
    moments = 16  # earliest starts that are tried
    for number in range(moments):
        earliest = here.limits.earliest + number * span / moments
        if number > 0 and earliest > IN_REACH * here.horizon:  # the rest is for the turn
            break
        try:
            damping = schedule(replace(here, limits=replace(here.limits, earliest=earliest)), SchemeOptions())
        except Infeasible as why:
            reason = why
            continue
        builder = start.fork()
        try:
            builder.fire(damping, bounded=True)
        except Infeasible as why:
            reason = why
            break
        cost = damping.total_impulse + h * (builder.here.to_turn + 2.0 * builder.here.nutation)
        if best is None or cost < best[0]:
            best = cost, builder
        steps += builder.steps
        if steps > PREDAMPING_INTEGRATED or work.exhausted():
            break
    if best is None:
        text = "the nutation is to be taken out first, and"
        # Its cure, where it has one, is for the damping alone.
        raise TooShort(f"{text} {reason.why}") if isinstance(reason, TooShort) else Infeasible(f"{text} {reason}")
    return best[1]

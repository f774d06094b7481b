"""One pulse of A|ω| against ω, Magnus 1970 (21): the nutation goes, H moves to the spin axis, by
θ0.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nutdamp.common import work
from nutdamp.errors import Infeasible, TooShort
from nutdamp.physics import response
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.schemes.sequential import ImpulseBuilder, at_hand, fire_components, no_alignment
from nutdamp.spacecraft.constraints import longest_useful, usable
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import Schedule

if TYPE_CHECKING:
    from nutdamp.schemes.valve_commands import FlownBuilder

TRAIN_SHARE = (
    0.25  # longest pulse of a train, as a share of T_ω: it loses 10 % of its impulse to its width
)

PREDAMPING_INTEGRATED = 20_000  # steps of integration after which no more of them are tried
IN_REACH = 0.5  # share of the horizon within which the damping begins: the rest is for the turn

LEFT_OVER = 0.01  # share of A|ω0| from which a remainder counts against a channel


def schedule(spacecraft: Spacecraft, options: SchemeOptions) -> Schedule:  # noqa: ARG001 - the signature of a scheme
    """One pulse, or a train of equal ones where on-times are too short or the torque too weak for
    one.

    A steerable torquer fires at once. A body-fixed channel waits until it opposes ω; the channel
    that needs the fewest pulses, then the least propellant (impulse where unknown), then ends
    first, is taken.
    """
    torquer = spacecraft.torquer
    if torquer is not None:
        train = _train(spacecraft, torquer)
        if train.pulses:
            return train.schedule()
        raise TooShort(
            "no pulse of the steerable torquer fits before the horizon of "
            f"{spacecraft.horizon:.4g} s"
        )
    channels = at_hand(spacecraft, usable(spacecraft))
    if (
        spacecraft.nutation_rate == 0.0
    ):  # no channel ever comes to oppose ω: those beside it take its components
        still = ImpulseBuilder(spacecraft)
        fire_components(still, channels)
        if still.pulses:
            return still.schedule()
    trains = [
        train for train in (_train(spacecraft, channel) for channel in channels) if train.pulses
    ]
    if not trains:
        raise no_alignment(spacecraft, channels)
    lacking = LEFT_OVER * spacecraft.least_impulse
    choices = [(not train.settled and train.left > lacking, train.schedule()) for train in trains]
    return min(
        choices, key=lambda choice: (choice[0], len(choice[1]), choice[1].cost, choice[1].end)
    )[1]


def _train(spacecraft: Spacecraft, actuator: Channel | Steerable) -> ImpulseBuilder:
    """The fewest equal pulses that take out what is left; fewer where the limits end it or nothing
    is gained.
    """
    start = ImpulseBuilder(spacecraft)
    slope = 0.0
    max_on_time = math.inf
    if isinstance(actuator, Channel):
        torque = abs(actuator.transverse)
        max_on_time = actuator.max_on_time
        slope = spacecraft.inertia.a * actuator.axial / spacecraft.inertia.C
    else:
        torque = math.inf if actuator.torque is None else actuator.torque

    def capacity(on_time: float) -> float:
        if math.isinf(torque) or math.isinf(on_time):
            return math.inf
        return torque * on_time * abs(response.width_factor(start.turning, slope, on_time))

    longest = longest_useful(max_on_time, start.period)
    most = start.most
    count = 1
    single = math.isinf(torque) or response.on_time_for(
        start.left, torque, start.turning, slope, longest
    )
    share = capacity(min(max_on_time, TRAIN_SHARE * start.period))
    if not single and share > 0.0:
        count = math.ceil(min(start.left / share, most + 1.0))
        if count > most:  # rather longer pulses than too many
            count = max(math.ceil(min(start.left / max(capacity(longest), share), most)), 1)
    # A channel that also spins up takes out less the longer it is on: one pulse may do what the
    # longest cannot.
    strongest = math.inf if single else capacity(longest)

    def fired(count: int) -> ImpulseBuilder:
        builder = ImpulseBuilder(spacecraft)
        for remaining in range(count, 0, -1):
            impulse = min(builder.left / remaining, strongest)
            if isinstance(actuator, Steerable):
                pulse = builder.steer(actuator, impulse)
            else:  # at its next alignment, as long as it can where that is too short
                on_time = builder.on_time_for(actuator, impulse)
                most = longest_useful(max_on_time, builder.period)
                pulse = builder.align(actuator, most if on_time is None else on_time)
            if builder.full or pulse is None or not builder.helps(pulse):
                break
            builder.fire(pulse)
        return builder

    train = fired(count)
    if spacecraft.growth > 0.0 and train.pulses and train.left > LEFT_OVER * start.left:
        # The nutation grows while the train waits for its moments: a pulse more than it takes now.
        train = min(train, fired(count + 1), key=lambda train: train.left)
    return train


def damped(start: FlownBuilder) -> FlownBuilder:
    """The ``start``, after the damping by one pulse or a train, from which the rest of the way
    costs least.

    H then goes to the momentary spin axis. Its pulses cost A|ω0| whenever they come, but the turn
    that is left, C|ω3| times its angle, differs by the cone. Raises Infeasible where no channel can
    damp, or the budget ends before.
    """
    at_leg = start.at_leg
    steps = 0
    # A torquer can fire at any point of the cone; channels at their alignments, which come by the
    # body period.
    span = (
        at_leg.inertial_period
        if at_leg.torquer is not None
        else 4.0 * min(at_leg.body_period, 0.1 * at_leg.horizon)
    )
    best: tuple[float, FlownBuilder] | None = None
    reason: Infeasible | None = None
    moments = 16  # earliest starts that are tried
    for number in range(moments):
        earliest = at_leg.limits.earliest + number * span / moments
        if number > 0 and earliest > IN_REACH * at_leg.horizon:  # the rest is for the turn
            break
        try:
            damping = schedule(with_limits(at_leg, earliest=earliest), SchemeOptions())
        except Infeasible as why:
            reason = why
            continue
        builder = start.fork()
        try:
            builder.fire(damping, bounded=True)
        except Infeasible as why:
            reason = why
            break
        cost = damping.total_impulse + abs(at_leg.axial) * (
            builder.at_leg.to_turn + 2.0 * builder.at_leg.nutation
        )
        if best is None or cost < best[0]:
            best = cost, builder
        steps += builder.steps
        if steps > PREDAMPING_INTEGRATED or work.exhausted():
            break
    if best is None:
        text = "the nutation is to be taken out first, and"
        # Its cure, where it has one, is for the damping alone.
        raise (
            TooShort(f"{text} {reason.why}")
            if isinstance(reason, TooShort)
            else Infeasible(f"{text} {reason}")
        )
    return best[1]

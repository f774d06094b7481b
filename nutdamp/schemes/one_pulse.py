"""One pulse of A|ω| against ω, Magnus 1970 (21): the nutation goes, H moves to the spin axis, by θ0."""

from __future__ import annotations

import math
from collections.abc import Callable

from nutdamp.errors import TooShort
from nutdamp.physics import response
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.schemes.sequential import ImpulseBuilder, at_hand, no_alignment
from nutdamp.spacecraft.constraints import longest_useful, usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule

TRAIN_SHARE = 0.25  # longest pulse of a train, as a share of T_ω: it loses 10 % of its impulse to its width

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
    return min(trains, key=_preference).schedule()


def _preference(builder: ImpulseBuilder) -> tuple[bool, int, float, float]:
    chosen = builder.schedule()
    lacks = not builder.settled and builder.left > LEFT_OVER * builder.spacecraft.least_impulse
    return lacks, len(chosen), chosen.cost, chosen.end


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

    longest = longest_useful(max_on_time, start.period)
    count = 1
    single = math.isinf(torque) or response.on_time_for(start.left, torque, start.turning, slope, longest)
    share = capacity(min(max_on_time, TRAIN_SHARE * start.period))  # a pulse as wide as that loses 10 % of its impulse
    if not single and share > 0.0:
        most = start.most
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

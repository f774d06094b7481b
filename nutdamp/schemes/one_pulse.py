"""One pulse of A|ω| against ω, Magnus 1970 (21): the nutation goes, H moves to the spin axis, by
θ0.
"""

from __future__ import annotations

import math

from nutdamp.errors import TooShort
from nutdamp.physics import response
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.schemes.sequential import ImpulseBuilder, fire_components, no_alignment
from nutdamp.spacecraft.constraints import at_hand, longest_useful, usable
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

TRAIN_SHARE = (
    0.25  # longest pulse of a train, as a share of T_ω: it loses 10 % of its impulse to its width
)

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

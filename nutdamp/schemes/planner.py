"""Interface of the schemes: a scheme's module has ``schedule(spacecraft, options)``; `catalogue`
lists them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib import import_module

from nutdamp.common.results import note
from nutdamp.errors import Infeasible, TooShort
from nutdamp.schemes.catalogue import (
    POINTING,
    SCHEMES,
    TWO_PULSE,
    FourPulseOptions,
    Options,
    Scheme,
    SchemeOptions,
)
from nutdamp.schemes.correction import Correction, SymmetricModel, left, model_of
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.units import instance

# rad that a schedule laid on the symmetric body leaves from which one is laid on the true motion
MODELLED = 1e-6

# Options of one scheme, of several, or None for the defaults.
Choice = Options | SchemeOptions | None


def settled(scheme: Scheme, chosen: Choice, spacecraft: Spacecraft) -> SchemeOptions:
    """Options of a scheme for a ``spacecraft``: H is kept where it has a target, or a bound on its
    shift.

    Raises BadRequest for the options of another scheme.
    """
    own = chosen or scheme.options()
    required = spacecraft.requirement
    if isinstance(own, Options):
        own = own.of(scheme.options)
    expected = f"{scheme.options.__name__}(…)"
    own = instance(f"options of {scheme.name}", own, scheme.options, expected)
    bound = required is not None and required.momentum_shift is not None
    return own.settled(keeps_axis=bound or spacecraft.goal.axis is not None)


def schedule(name: str, spacecraft: Spacecraft, options: Choice = None) -> Schedule:
    """Pulses of the scheme ``name``, disturbances and all.

    The scheme plans on the symmetric, undisturbed `sequential` of the spacecraft; where that is not
    exact, the last pulse (the last four of schemes that keep or turn H) is corrected on the true
    motion. Raises Infeasible with the reason where the scheme cannot work within the limits, and
    KeyError for a name not in `NAMES`.
    """
    scheme = SCHEMES[name]
    chosen = settled(scheme, options, spacecraft)
    if not scheme.fires:
        return Schedule()
    if scheme.by_turns and spacecraft.spin == 0.0:
        raise Infeasible(
            "the body does not turn about axis 3: there is no spin turn to fire once in"
        )
    planned: Callable[[Spacecraft, SchemeOptions], Schedule] = import_module(scheme.module).schedule
    if scheme.on_true_body:
        return planned(spacecraft, chosen)
    if spacecraft.thrust_laws:
        from nutdamp.schemes import valve_commands  # valves, tanks or cold nozzles

        on_plain = valve_commands.options(spacecraft, chosen)
        correct = Correction(scheme, on_plain)
        return valve_commands.planned(
            spacecraft, lambda without_valves: schedule(name, without_valves, on_plain), correct
        )
    model = model_of(spacecraft, turning=chosen.equal, three_moments=scheme.three_moments)
    try:
        whole = planned(model.symmetric, chosen)
    except TooShort as short:
        from nutdamp.schemes.sequential import why  # no plan

        def attempt(limited: Spacecraft) -> Schedule | None:
            with suppress(Infeasible):
                return planned(limited, chosen)
            return None

        raise TooShort(short.why, short.cure or why(model.symmetric, attempt).text) from None
    made = _corrected(scheme, model, whole, chosen)
    like_model = spacecraft.inertia.symmetric or spacecraft.disturbances or chosen.uncorrected
    if like_model or not isinstance(chosen, FourPulseOptions):
        return made
    remains = left(spacecraft, made, momentum=False)
    if not remains > MODELLED:
        return made
    from nutdamp.schemes import legs  # three moments

    on_true = legs.on_true_motion(spacecraft, chosen)
    other = Correction(scheme, chosen)(spacecraft, on_true)
    less = left(spacecraft, other, momentum=False) < remains
    return other if less and keeps_limits(spacecraft, other.pulses) else made


def alternatives(name: str, spacecraft: Spacecraft, options: Choice = None) -> list[Schedule]:
    """Schedules that the scheme ``name`` weighs against the one that `schedule` gives, which may be
    among them.

    Raises KeyError for a name not in `NAMES`.
    """
    scheme = SCHEMES[name]
    if scheme is not TWO_PULSE:
        return []
    chosen = settled(scheme, options, spacecraft)
    if spacecraft.thrust_laws:
        from nutdamp.schemes import valve_commands  # valves, tanks or cold nozzles

        schedules = alternatives(
            name,
            valve_commands.without_valves(spacecraft),
            valve_commands.options(spacecraft, chosen),
        )
        return [as_commands(name, spacecraft, schedule, chosen) for schedule in schedules]
    model = model_of(spacecraft)
    schedules = import_module(scheme.module).alternatives(model.symmetric, chosen)
    return [_corrected(scheme, model, schedule, chosen) for schedule in schedules]


def as_commands(
    name: str, spacecraft: Spacecraft, schedule: Schedule, options: Choice = None
) -> Schedule:
    """A schedule ``schedule`` for a ``spacecraft`` `without_valves` as its commands, corrected
    on its motion.

    Raises KeyError for a name not in `NAMES`.
    """
    from nutdamp.schemes import valve_commands  # valves, tanks or cold nozzles

    scheme = SCHEMES[name]
    chosen = valve_commands.options(spacecraft, settled(scheme, options, spacecraft))
    return valve_commands.as_commands(spacecraft, schedule, Correction(scheme, chosen))


def _corrected(
    scheme: Scheme, model: SymmetricModel, schedule: Schedule, options: SchemeOptions
) -> Schedule:
    """A schedule for the ``model`` as one for the true spacecraft, corrected on its motion where
    that differs.
    """
    schedule = model.translate(schedule)
    if not model.exact:
        schedule = schedule.without_proof
    if model.spacecraft.goal.axis is not None and not scheme.points and schedule.pulses:
        aside = note("does-not-point", schemes=", ".join(POINTING))
        schedule = replace(schedule, notes=(*schedule.notes, aside))
    if model.exact:
        return schedule
    return Correction(scheme, options)(model.spacecraft, schedule)

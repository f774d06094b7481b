"""What is of its own in the certificate of a robust plan: the cones, their tangents with prices, and a firing.

With E(t) = e^{i rate (t + delay)} min(1, e^{-κ (t - t_last)}), where κ is ``growth_per_s`` for the nutation and zero
else, a second of a channel at t adds E effect to what is left of a kind, and one sigma of input k changes that by
E (changes_k + i t rates_k effect); for inputs of ``each_pulse`` by what the pulse itself has drawn, where all that a
channel fires within a turn, floor((t - earliest) / turn), is one pulse. Without firing, -goal is left, and one sigma
of input k changes that by start_k. With the margin m, a tangent of the unit vectors u (complex) and w (``shared``
and ``each_pulse`` together) asks of what is left, r, and of its changes S:

    Re(u* r) + m Σ w Re(u* S) ≤ most.

With y its ``price`` and a(t) what a second adds to its left side, q(t) is -Σ y a(t) over ``cost_per_s``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nutdamp.certificate import SureCertificate
from nutdamp.schemes.optimal.chance_model import KINDS, TURNS, ChanceModel, Complex, Limit, Tangent
from nutdamp.spacecraft import Vector

PROVES = (
    "no firing of these channels within the windows that keeps, to first order, what is left within most in every "
    "direction with a margin of margin_sigmas standard deviations costs less than bound = sum of price times (Re(u* "
    "goal) - most + margin sum of w Re(u* start)) - gained: every such firing keeps every tangent, and q is at most 1 "
    "at every moment for channels that act at once; for the others gained is at least the integral of cost_per_s times "
    "(q - 1) where q is above 1"
)
NOT_PROVED = (
    "that a share of probability of the cases complies: the margin was chosen by flying cases, and the bound is about "
    "the cones at that margin alone; the plan is made from such a firing, refined on the true motion, and may cost "
    "more or less"
)
MODEL = (
    "small angles, symmetric body, spin as at t = 0; of first order in the dispersed inputs, each of one standard "
    "deviation (correlated ones made independent: what each adds to those before it), with biases taken in; impulses "
    "of any size at once for channels with acts_at_once, at most the full torque at a time for the others; the windows "
    "end where a standard deviation would turn what a pulse does by too much for first order"
)


def sure_json(found: SureCertificate) -> dict[str, Any]:
    """The part that no other certificate has."""
    model, proof, program = found.chance.model, found.proof, found.program
    own = model.uncertain.own.tolist()
    priced = zip(proof.tangents, proof.prices.tolist(), strict=True)
    return {
        "earliest_s": found.spacecraft.limits.earliest,
        "turn_s": model.turn,
        "probability": found.probability,
        "margin_sigmas": found.margin,
        "inputs": [{"name": name, "each_pulse": each} for name, each in zip(model.uncertain.names, own, strict=True)],
        "channels": [
            {"name": channel.name, "cost_per_s": cost, "acts_at_once": at_once, "delay_s": delay}
            for channel, cost, at_once, delay in zip(
                program.channels,
                program.costs.tolist(),
                found.chance.strong.tolist(),
                model.uncertain.delay.tolist(),
                strict=True,
            )
        ],
        "kinds": {KINDS[limit.kind]: _kind(model, limit) for limit in model.limits},
        "tangents": [_tangent(model, one, price) for one, price in priced],
        "gained": proof.gained,
        "bound": found.bound,
        "firings": _firings(found),
        "firings_cost": found.cost,
        "passed": proof.passed,
        "gap": found.cost / found.bound - 1.0,
    }


def _pair(value: complex) -> list[float]:
    return [float(value.real), float(value.imag)]


def _pairs(values: Complex) -> list[list[float]]:
    return [_pair(one) for one in values.tolist()]


def _kind(model: ChanceModel, limit: Limit) -> dict[str, Any]:
    kind = limit.kind
    effects, changes = model.effects(kind)
    return {
        "most_Nms": limit.most,
        "goal_Nms": _pair(complex(model.goal[kind])),
        "start_Nms": _pairs(np.where(model.uncertain.own, 0.0, model.start(kind))),
        "rate_rad_s": float(model.pace[kind]) if kind < 2 else 0.0,
        "rates_rad_s": model.rates(kind).tolist(),
        "channels": {
            channel.name: {"effect_Nm": _pair(complex(effect)), "changes_Nm": _pairs(each)}
            for channel, effect, each in zip(model.program.channels, effects, changes, strict=True)
        },
    }


def _tangent(model: ChanceModel, one: Tangent, price: float) -> dict[str, Any]:
    def along(row: Vector) -> dict[str, Any]:
        channel, turn = divmod(int(row[0]), TURNS)
        return {"channel": model.program.channels[channel].name, "turn": turn, "w": row[1:].tolist()}

    return {
        "kind": KINDS[one.limit.kind],
        "u": _pair(one.u),
        "shared": one.shared.tolist(),
        "each_pulse": [along(row) for row in one.own],
        "price": price,
    }


def _firings(found: SureCertificate) -> list[dict[str, Any]]:
    """The firing, in slots of ``width_s``, or of none at once."""
    columns, on_times = found.proof.columns, found.proof.on_times
    q = found.primer(columns.t)[np.arange(len(columns.t)), columns.channel]
    order = np.argsort(columns.t, kind="stable").tolist()
    return [
        {
            "channel": found.program.channels[int(columns.channel[at])].name,
            "t_s": float(columns.t[at]),
            "width_s": float(columns.width[at]),
            "on_time_s": float(on_times[at]),
            "q": float(q[at]),
        }
        for at in order
    ]

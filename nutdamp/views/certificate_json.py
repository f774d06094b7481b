"""The file of ``plan --certificate``: all data to check a least cost by hand, in SI.

It is about the transverse impulse of a symmetric body of small angles. With E1 = e^{i α t} min(1, e^{-κ (t - t_last)})
and E2 = e^{i ω t}, where α is ``nutation_rad_s``, ω is ``spin_rad_s`` and κ is ``growth_per_s``, a second of a channel
of the torque (m1, m2, m3) at t adds E1 (m1 + i m2) to the equations nutation, E2 (m1 + i m2) to the equations shift,
and m3 to the equation spin. Of each equation the file has the goal and the price y, and q(t) of a channel is the sum of
y times what it adds, over ``cost_per_s``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nutdamp import __version__
from nutdamp.planning.tradeoff import Certificate
from nutdamp.schemes.optimal.linear_program import Burn

PROVES = (
    "no firing of these channels within the windows that reaches the goal by the equations costs less than bound = "
    "sum of price times goal - off times |prices of shift| - gained: q is at most 1 at every moment for channels that "
    "act at once, and for the others gained is at least the integral of cost_per_s times (q - 1) where q is above 1"
)
MODEL = (
    "small angles, symmetric body, spin as at t = 0: exact for the nutation as long as nothing changes the spin, of "
    "first order for the direction of H; impulses of any size at once for channels with acts_at_once, at most the full "
    "torque at a time for the others"
)
NOT_COUNTED = (
    "gaps, ticks, least and longest on-times, max_pulses, that channels may not be on together, valves, cold nozzles "
    "and falling pressure: each can only raise the cost of the same equations"
)


def certificate_json(certificate: Certificate) -> dict[str, Any]:
    """The certificate as data."""
    body, program, proof = certificate.spacecraft, certificate.program, certificate.proof
    equations = zip(certificate.rows, program.influence.goal.tolist(), proof.prices.tolist(), strict=True)
    names, pulses = [channel.name for channel in program.channels], certificate.plan.pulses
    return {
        "nutdamp": __version__,
        "certificate": 1,
        "spacecraft": body.name,
        "proves": PROVES,
        "model": MODEL,
        "not_counted": NOT_COUNTED,
        "a": body.inertia.a,
        "spin_rad_s": body.spin,
        "nutation_rad_s": body.inertia.a * body.spin,
        "growth_per_s": body.growth,
        "last_s": certificate.last,
        "windows_s": [list(span) for span in certificate.windows],
        "unit": certificate.problem.unit,
        "equations": [{"name": name, "goal_Nms": goal + 0.0, "price": price + 0.0} for name, goal, price in equations],
        "off_Nms": program.off,
        "channels": [
            {
                "name": channel.name,
                "torque_Nm": channel.torque.tolist(),
                "cost_per_s": float(cost),
                "acts_at_once": bool(strong),
            }
            for channel, cost, strong in zip(program.channels, program.costs, program.strong, strict=True)
        ],
        "gained": proof.gained,
        "bound": proof.bound,
        "burns": [_burn(certificate, burn) for burn in certificate.burns],
        "burns_cost": certificate.cost,
        "plan": {
            "cost": pulses.cost_in(certificate.problem.unit),
            "pulses": [{"channel": pulse.channel, "t_s": pulse.t, "on_time_s": pulse.on_time} for pulse in pulses],
        },
        "primer": [
            {"t_s": times.tolist(), "q": dict(zip(names, certificate.primer(times).T.tolist(), strict=True))}
            for times in certificate.moments()
        ],
    }


def _burn(certificate: Certificate, burn: Burn) -> dict[str, Any]:
    at = certificate.program.channels.index(burn.channel)
    q = certificate.primer(np.array([burn.t]))[0, at]
    return {"channel": burn.channel.name, "t_s": burn.t, "on_time_s": burn.on_time, "q": float(q)}

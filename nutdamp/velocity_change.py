"""What pulses add to the velocity: the integral of their forces as the body turns."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from nutdamp.flight import Flight
from nutdamp.physics import attitude
from nutdamp.schedule import Pulse
from nutdamp.spacecraft import Vector

LEGENDRE = ((-0.8611363115940526, 0.34785484513745385), (-0.33998104358485626, 0.6521451548625461))
"""Half of the four-point Gauss-Legendre rule on [-1, 1]: (node, weight); the other half is its mirror image."""


def momentum_gained(flown: Flight) -> Vector:
    """∫ R(t) F dt over all pulses, (3,) N s, by Gauss-Legendre over stretches of at most half a radian."""
    gained = np.zeros(3)
    nodes, weights = np.array([(sign * node, weight) for node, weight in LEGENDRE for sign in (1.0, -1.0)]).T
    for leg in flown.legs:
        firing = [p for p in flown.schedule if p.thrust[0] <= leg.start and leg.end <= p.thrust[1]]
        if leg.end == leg.start or not any(p.force is not None and p.force.any() for p in firing):
            continue
        ends = leg.path.motion(np.array([leg.start, leg.end]))[0]
        turned = float(np.linalg.norm(ends, axis=1).max()) * (leg.end - leg.start)
        edges = np.linspace(leg.start, leg.end, math.ceil(turned / 0.5) + 1)
        middles, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (edges[1] - edges[0])
        times = (middles[:, None] + half * nodes).ravel()
        pushes = attitude.rotate(leg.path.motion(times)[1], _forces(firing, times)).reshape(-1, len(nodes), 3)
        gained += half * np.einsum("snc,n->c", pushes, weights)
    return gained


def _forces(firing: Iterable[Pulse], times: Vector) -> Vector:
    """Force (3,) N of pulses, or (n, 3) at the ``times`` (n,) s where that of one of them rises or falls."""
    total = np.zeros(3)
    for pulse in firing:
        if pulse.force is None:
            continue
        if pulse.command is None:
            total = total + pulse.force
            continue
        corners = [(ramp.begin, ramp.first) for ramp in pulse.command.ramps]
        corners += [(ramp.end, ramp.last) for ramp in pulse.command.ramps]
        places, levels = np.array(sorted(corners, key=lambda one: one[0])).T
        total = total + np.interp(times, places, levels)[:, None] * pulse.force
    return np.asarray(total)

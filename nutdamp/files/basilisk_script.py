"""A script that flies a schedule in Basilisk and prints what is left: for whoever has Basilisk and not nutdamp."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from nutdamp import __version__
from nutdamp.basilisk import default_step, stretches
from nutdamp.errors import BadRequest
from nutdamp.lightening import shed
from nutdamp.planning import Plan
from nutdamp.spacecraft import Spacecraft, Vector

LONGEST_STEP = 0.1
"""rad; the body turns by no more in one step of the script."""


def basilisk_script(plan: Plan) -> str:
    """The text of the script: data of the body and of each stretch of constant torque, and the code that flies them.

    Raises BadRequest for a body with energy dissipation, or moments that fall, which a rigid hub has not.
    """
    body = plan.spacecraft
    if body.dissipation is not None:
        raise BadRequest("a Basilisk script flies a rigid body: leave dissipation out of the spacecraft file")
    if shed(body) is not None:
        problem = "a Basilisk script flies constant moments of inertia: leave tank.inertia_per_kg out of the spacecraft"
        raise BadRequest(f"{problem} file, and plan without it, if the moments may count as constant")
    rates, quaternion = body.inertia.in_file_axes(body.initial.rates, body.initial.quaternion)
    title = " ".join(f"{plan.scheme} schedule for {body.name}".split()).replace("\\", "/").replace('"', "'")
    return _SCRIPT.format(
        title=title,
        version=__version__,
        tensor=_rows(body.inertia.tensor),
        moments=_vector(body.inertia.moments),
        axes=_rows(body.inertia.axes),
        rates=_vector(rates),
        quaternion=_vector(quaternion),
        turn=LONGEST_STEP,
        steps="\n".join(f"    {step}," for step in _steps(plan, body)),
    )


def _steps(plan: Plan, body: Spacecraft) -> Iterable[str]:
    """Rows of the schedule: what fires, how long, torque; an ideal impulse lasts no time and gives its impulse."""
    pulses, axes = plan.pulses, body.inertia.axes
    longest = default_step(body, pulses, pulses.end)
    edges = sorted({0.0, pulses.end, *(edge for pulse in pulses for edge in pulse.edges)})
    for now, end in zip(edges, [*edges[1:], pulses.end], strict=True):
        for pulse in pulses:
            if pulse.torque is None and pulse.t == now:
                yield f"({pulse.channel!r}, 0.0, {_vector(axes @ pulse.impulse)})"
        firing = [pulse.channel for pulse in pulses if pulse.push(now, end) is not None]
        if end > now:
            for duration, torque in stretches(body, pulses, now, end, longest):
                yield f"({' + '.join(firing) or 'coast'!r}, {float(duration)!r}, {_vector(axes @ torque)})"


def _vector(vector: Iterable[float] | Vector) -> str:
    return "[" + ", ".join(repr(float(part) + 0.0) for part in vector) + "]"


def _rows(matrix: Vector) -> str:
    return "[" + ", ".join(_vector(row) for row in np.asarray(matrix)) + "]"


_SCRIPT = '''\
"""{title}, flown by Basilisk. Written by nutdamp {version}.

Run it with Python and Basilisk (pip install bsk). Vectors are in the axes of the spacecraft file; units are SI.
"""

import math

import numpy as np
from Basilisk.architecture import bskLogging
from Basilisk.simulation import extForceTorque, spacecraft, svIntegrators
from Basilisk.utilities import SimulationBaseClass

INERTIA = np.array({tensor})
PRINCIPAL_MOMENTS = {moments}
PRINCIPAL_AXES = np.array({axes})  # columns
RATES = np.array({rates})  # at t = 0
QUATERNION = {quaternion}  # body -> inertial at t = 0, scalar first

# What fires, for how many seconds, and the torque in N m (an impulse in N m s where it lasts no time).
SCHEDULE = [
{steps}
]

STEP = 10_000_000  # ns of the simulation's clock
TURN = {turn}  # rad by which the body turns in one step at most


def main():
    simulation = SimulationBaseClass.SimBaseClass()
    simulation.bskLogger.setLogLevel(bskLogging.BSK_ERROR)
    simulation.CreateNewProcess("flight").addTask(simulation.CreateNewTask("dynamics", STEP))
    body = spacecraft.Spacecraft()
    body.hub.IHubPntBc_B = INERTIA.tolist()
    body.hub.omega_BN_BInit = column(RATES)
    body.hub.sigma_BNInit = column(to_mrp(np.array(QUATERNION)))
    push = extForceTorque.ExtForceTorque()
    body.addDynamicEffector(push)
    integrator = svIntegrators.svIntegratorRKF78(body)
    integrator.relTol = integrator.absTol = 1e30  # keep the step given
    body.setIntegrator(integrator)
    for model in (body, push):
        simulation.AddModelToTask("dynamics", model)
    simulation.InitializeSimulation()
    rates = body.dynManager.getStateObject(body.hub.nameOfHubOmega)
    attitude = body.dynManager.getStateObject(body.hub.nameOfHubSigma)

    def momentum():
        """Angular momentum in the inertial frame."""
        return to_inertial(np.ravel(attitude.getState()), INERTIA @ np.ravel(rates.getState()))

    before, clock = momentum(), 0
    for _, duration, torque in SCHEDULE:
        now = np.ravel(rates.getState())
        if duration == 0.0:
            rates.setState(column(now + np.linalg.solve(INERTIA, torque)))
            continue
        # The clock counts whole nanoseconds and stops on whole steps only. So time is counted in a unit in which this
        # stretch lasts a whole number of steps: rates times the unit, torque times its square, which leaves Euler's
        # equations as they are. Pulses begin and end exactly when they should.
        fastest = np.linalg.norm(now) + np.linalg.norm(torque) * duration / min(PRINCIPAL_MOMENTS)
        steps = max(math.ceil(fastest * duration / TURN), 1)
        unit = duration / (steps * STEP * 1e-9)
        push.extTorquePntB_B = column(np.array(torque) * unit**2)
        rates.setState(column(now * unit))
        clock += steps * STEP
        simulation.ConfigureStopTime(clock)
        simulation.ExecuteSimulation()
        rates.setState(column(np.ravel(rates.getState()) / unit))

    left = PRINCIPAL_AXES.T @ np.ravel(rates.getState())
    sense = math.copysign(1.0, (PRINCIPAL_AXES.T @ RATES)[2])
    after = momentum()
    shift = math.atan2(np.linalg.norm(np.cross(before, after)), before @ after)
    nutation, body_cone = largest_cones(left, sense)
    print("nutation left ", shown(nutation))
    print("body cone     ", shown(body_cone))
    print("shift of H    ", shown(shift))


def largest_cones(rates, sense):
    """Largest angle between H and the spin axis on the torque-free motion that follows, and the body cone then."""
    first, second, third = PRINCIPAL_MOMENTS
    h = PRINCIPAL_MOMENTS * rates
    square, moment = h[0] ** 2 + h[1] ** 2, first
    if first != second:
        # 2T - H²/I3 and H are constant; the angle is largest where the momentum about one of the two axes is zero.
        excess = h[0] ** 2 * (1 / first - 1 / third) + h[1] ** 2 * (1 / second - 1 / third)
        crossings = [(excess / (1 / one - 1 / third), one) for one in (first, second) if one != third]
        pick = max if sense * h[2] >= 0.0 else min
        square, moment = pick([one for one in crossings if one[0] <= h @ h], default=(h @ h, first))
    transverse, axial = math.sqrt(square), sense * math.copysign(math.sqrt(h @ h - square), h[2])
    return math.atan2(transverse, axial), math.atan2(transverse / moment, axial / third)


def to_mrp(q):
    """Modified Rodrigues parameters of a quaternion."""
    upper = -q if q[0] < 0 else q
    return upper[1:] / (1 + upper[0])


def to_inertial(sigma, vector):
    """A body vector in the inertial frame, by the body's modified Rodrigues parameters."""
    square = sigma @ sigma
    once = np.cross(sigma, vector)
    return vector + (4 * (1 - square) * once + 8 * np.cross(sigma, once)) / (1 + square) ** 2


def column(vector):
    return [[float(part)] for part in vector]


def shown(angle):
    degrees = math.degrees(angle)
    return f"{{degrees:.4g}} deg" if abs(degrees) >= 1e-9 else "< 1e-9 deg"


if __name__ == "__main__":
    main()
'''

"""Times of the work inside one process, for `run.py`: rows of its table as JSON, on standard
output.

    python tests/benchmarks/inside.py    (in a folder with dispersed.yaml)

The peers are what one would else write: `scipy.integrate.solve_ivp` (DOP853, rtol 1e-10) on Euler's
equations and the quaternion, one case at a time from edge to edge; and Basilisk, where it is
installed.
"""

import importlib.util
import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

sys.path.append(str(Path(__file__).parents[1]))

from support.flights import realised

from nutdamp import load
from nutdamp.flight import propagation
from nutdamp.montecarlo.study import Results, run, study_of, threads_here
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

Array = NDArray[np.float64]

PEER_CASES = 30
"""Cases that the peers fly in each turn; all take nearly the same time."""

TURNS = 5


def medians(works: dict[str, Callable[[], int]]) -> dict[str, float]:
    """Median time in s of one case of each work; they take turns, and each tells how many cases it
    flew.
    """
    times: dict[str, list[float]] = {name: [] for name in works}
    for turn in range(TURNS + 1):
        for name, work in works.items():
            start = time.perf_counter()
            cases = work()
            if turn > 0:
                times[name].append((time.perf_counter() - start) / cases)
    return {name: statistics.median(values) for name, values in times.items()}


def by_solve_ivp(body: Spacecraft, schedule: Schedule) -> Array:
    """Rates and quaternion (7,) at the end of the last pulse."""
    I1, I2, I3 = body.inertia.moments

    def slope(_: float, y: Array, m1: float, m2: float, m3: float) -> list[float]:
        w1, w2, w3, q0, q1, q2, q3 = y.tolist()
        return [
            (m1 - (I3 - I2) * w2 * w3) / I1,
            (m2 - (I1 - I3) * w3 * w1) / I2,
            (m3 - (I2 - I1) * w1 * w2) / I3,
            -0.5 * (q1 * w1 + q2 * w2 + q3 * w3),
            0.5 * (q0 * w1 + q2 * w3 - q3 * w2),
            0.5 * (q0 * w2 + q3 * w1 - q1 * w3),
            0.5 * (q0 * w3 + q1 * w2 - q2 * w1),
        ]

    y = np.array([*body.omega0, *body.initial.quaternion])
    now = 0.0
    for pulse in schedule:
        torque = np.zeros(3) if pulse.torque is None else pulse.torque
        for end, acting in ((pulse.start, np.zeros(3)), (pulse.end, torque)):
            if end > now:
                solved = solve_ivp(
                    slope,
                    (now, end),
                    y,
                    method="DOP853",
                    rtol=1e-10,
                    atol=1e-12,
                    args=tuple(acting),
                )
                y = solved.y[:, -1]
                now = end
    return np.asarray(y)


def works() -> dict[str, Callable[[], int]]:
    """What is timed, by name."""
    body = load("dispersed.yaml")
    schedule = planning.plan(body, "two-pulse").pulses
    settled = propagation.flown(body, schedule).settled
    assert (
        np.abs(by_solve_ivp(body, schedule)[:3] - settled.rates).max() < 1e-7
    )  # the peer does the same work
    study = study_of(body, schedule)
    truths = [realised(study.model, study.draws_of(case)) for case in range(PEER_CASES)]

    def single() -> int:
        for true, pulses in truths:
            _ = propagation.flown(true, pulses).residual
        return len(truths)

    def peer() -> int:
        for true, pulses in truths:
            by_solve_ivp(true, pulses)
        return len(truths)

    def simulator() -> int:
        from nutdamp.flight import basilisk

        for true, pulses in truths[:5]:
            basilisk.fly(true, pulses, pulses.end, samples=2)
        return 5

    def dispersed(threads: int) -> Callable[[], int]:
        def work() -> int:
            percentiles(run(Results(study, 10**5), threads=threads))
            return 10**5

        return work

    found = {
        "one flight": single,
        "solve_ivp": peer,
        "all threads": dispersed(threads_here()),
        "one thread": dispersed(1),
    }
    if importlib.util.find_spec("Basilisk") is not None:
        found["Basilisk"] = simulator
    else:
        print("Basilisk is not installed (extra verify): not compared", file=sys.stderr)
    return found


def rows() -> list[dict[str, Any]]:
    """The rows of the table."""
    times = medians(works())
    found: list[dict[str, Any]] = []

    def faster(name: str, of: str, than: str, limit: float | None = None) -> None:
        ratio = times[than] / times[of]
        against = f"faster than {than}"
        found.append(
            {
                "name": name,
                "seconds": times[of],
                "ratio": ratio,
                "against": against,
                "limit": limit,
                "at_least": True,
            }
        )

    faster("a single flight", "one flight", "solve_ivp")
    faster("a case flown, all threads", "all threads", "solve_ivp")
    faster("a case flown, one thread", "one thread", "solve_ivp", 100.0)
    if "Basilisk" in times:
        faster("a case flown, one thread", "one thread", "Basilisk")
    return found


def percentiles(results: Results) -> Array:
    """What a study is requested."""
    distribution = results.distribution("nutation")
    assert distribution is not None
    return np.asarray(distribution.quantiles(np.array([0.5, 0.9, 0.95, 0.99, 0.997])))


if __name__ == "__main__":
    print(json.dumps(rows()))

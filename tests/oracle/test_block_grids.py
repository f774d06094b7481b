"""Command blocks of small grids: none of all sequences of one to three blocks, flown, complies for
less.
"""

import itertools
import math

import numpy as np
import pytest
from support.builders import present
from support.cases import spread

import nutdamp
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_model import fire_all, spin_turn
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Block

CHEAPER = 0.99  # a plan may be dearer by 1 %
MOST = 20_000  # sequences of a grid, so that all can be flown


def grid(seed: int) -> tuple[nutdamp.Spacecraft, int]:
    """A spinner of two axial thrusters, few delays, one or two widths, one or two pulses a block;
    and how many blocks.

    One in two also bounds the shift of the momentum. Odd seeds are like the seed before, but spin
    the other way and are three times as large.
    """
    rng = np.random.default_rng(seed // 2)
    sign, scale = (-1.0, 3.0) if seed % 2 == 1 else (1.0, 1.0)
    A = 10.0 ** rng.uniform(0.5, 2.5)
    spin = rng.uniform(0.8, 2.0)
    C = A * rng.uniform(0.7, 1.7)
    turn = 2.0 * math.pi / spin
    degrees, phase, azimuth, at = rng.uniform(1.0, 6.0), *rng.uniform(-math.pi, math.pi, 3)
    blocks = 1 + seed // 2 % 3
    delays, widths, count, turns = ((12, 6, 9, 12.3), (3, 2, 2, 4.3), (3, 1, 1, 5.3))[blocks - 1]
    width = rng.uniform(0.05, 0.12) * turn
    strong = 2.0 * C * spin * math.sin(math.radians(degrees)) / (width * rng.uniform(2.0, 5.0))
    bounds = {"nutation": f"{degrees * rng.uniform(0.15, 0.4)} deg"}
    if seed // 6 % 2 == 1:
        bounds["momentum_shift"] = f"{degrees * rng.uniform(0.2, 0.6)} deg"
    jets = [
        {
            "name": name,
            "position": [math.cos(sign * angle), math.sin(sign * angle), 0.0],
            "direction": [0, 0, way],
            "force": scale * strong,
            "isp": 200.0,
        }
        for name, angle, way in (("J0", at, 1), ("J1", at + rng.uniform(1.0, 2.2), -1))
    ]
    file = {
        "name": "grid",
        "inertia": {"A": scale * A, "C": scale * C},
        "state": {"spin": sign * spin, "nutation": f"{degrees} deg", "phase": sign * phase},
        "attitude": {"quaternion": [1, 0, 0, 0]},
        "sun": [sign * 1.2, 0.3],
        "sun_sensor": {"azimuth": sign * azimuth},
        "thrusters": jets,
        "commands": {
            "delay_step": turn / (delays + 0.3),
            "delay_max": (delays - 1) * turn / (delays + 0.3),
            "width": (width * np.linspace(0.6, 1.0, widths)).tolist() if widths > 1 else [width],
            "max_count": count,
            "every": [1],
        },
        "limits": {"horizon": turns * turn},
        "requirement": bounds,
    }
    return nutdamp.load(file), blocks


def blocks_of(body: nutdamp.Spacecraft) -> list[Block]:
    """All blocks that end before the horizon."""
    commands = present(body.commands)
    last = int(body.horizon / spin_turn(body)) + 1
    steps = range(round(commands.delay_max / commands.delay_step) + 1)
    return [
        Block(channel.name, first, step * commands.delay_step, width, count)
        for channel, first, width, step in itertools.product(
            body.channels, range(1, last + 1), commands.widths.tolist(), steps
        )
        for count in range(1, min(commands.max_count, last - first + 1) + 1)
    ]


def cheapest(body: nutdamp.Spacecraft, most: int, below: float) -> float:
    """The least propellant, kg, below that of up to ``most`` blocks that comply; ``below`` where
    none does.
    """
    flow = {one.name: one.mass_flow or 0.0 for one in body.channels}
    single = blocks_of(body)
    sequences: list[tuple[Block, ...]] = [()]
    every: list[tuple[float, tuple[Block, ...]]] = []
    for _ in range(most):
        sequences = [
            (*before, block)
            for before in sequences
            for block in single
            if not before or block.first > before[-1].sun_pulses[-1]
        ]
        for sequence in sequences:
            cost = math.fsum(flow[one.channel] * one.width * one.count for one in sequence)
            if cost < below:
                every.append((cost, sequence))
    assert len(every) <= MOST
    every.sort(key=lambda one: one[0])
    for begin in range(0, len(every), 500):
        some = every[begin : begin + 500]
        for (cost, _), made in zip(some, fire_all(body, [one[1] for one in some])[0], strict=True):
            if isinstance(made, Infeasible) or made.end > body.horizon:
                continue
            end = left_by(propagation.flown(body, made))
            if all(one.met for one in requirements.held(body, end)):
                return cost
    return below


@spread("seed", range(40), quick=3, deep=37)
def test_no_blocks_of_a_small_grid_are_cheaper(seed: int) -> None:
    body, most = grid(seed)
    plan = nutdamp.plan(body, "command-block", nutdamp.Options(max_blocks=most))
    if plan.meets_requirement:
        below = CHEAPER * present(plan.propellant)
        assert cheapest(body, most, below) == pytest.approx(below)
    else:
        assert math.isinf(cheapest(body, most, math.inf))

"""Command blocks of small grids: no sequence of one or two blocks complies for less."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from support.builders import present
from support.cases import spread

import nutdamp
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_model import fired, spin_turn
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Block


def grid(seed: int) -> nutdamp.Spacecraft:
    """A spinner of two axial thrusters, three delays, two widths, and up to two pulses a block.

    Odd seeds are like the seed before, but spin the other way and are three times as large.
    """
    rng = np.random.default_rng(seed // 2)
    reversed_ = seed % 2 == 1
    A = 10.0 ** rng.uniform(0.5, 2.5)
    spin = rng.uniform(0.8, 2.0)
    scale = 3.0 if reversed_ else 1.0
    C = A * rng.uniform(0.7, 1.7)
    turn = 2.0 * math.pi / spin
    sign = -1.0 if reversed_ else 1.0
    degrees, phase, azimuth, at = rng.uniform(1.0, 6.0), *rng.uniform(-math.pi, math.pi, 3)
    delays = 3
    width = rng.uniform(0.05, 0.12) * turn
    strong = 2.0 * C * spin * math.sin(math.radians(degrees)) / (width * rng.uniform(2.0, 5.0))
    return nutdamp.load(
        {
            "name": "grid",
            "inertia": {"A": scale * A, "C": scale * C},
            "state": {"spin": sign * spin, "nutation": f"{degrees} deg", "phase": sign * phase},
            "attitude": {"quaternion": [1, 0, 0, 0]},
            "sun": [sign * 1.2, 0.3],
            "sun_sensor": {"azimuth": sign * azimuth},
            "thrusters": [
                {
                    "name": name,
                    "position": [math.cos(sign * angle), math.sin(sign * angle), 0.0],
                    "direction": [0, 0, way],
                    "force": scale * strong,
                    "isp": 200.0,
                }
                for name, angle, way in (("J0", at, 1), ("J1", at + rng.uniform(1.0, 2.2), -1))
            ],
            "commands": {
                "delay_step": turn / (delays + 0.3),
                "delay_max": (delays - 1) * turn / (delays + 0.3),
                "width": [width, 0.6 * width],
                "max_count": 2,
                "every": [1],
            },
            "limits": {"horizon": 4.3 * turn},
            "requirement": {"nutation": f"{degrees * rng.uniform(0.15, 0.4)} deg"},
        }
    )


def blocks_of(body: nutdamp.Spacecraft, first: int) -> Iterator[Block]:
    """All blocks from the ``first`` Sun pulse on that end before the horizon."""
    commands = present(body.commands)
    last = int(body.horizon / spin_turn(body)) + 1
    for channel in body.channels:
        for number in range(first, last + 1):
            for width in commands.widths.tolist():
                for count in range(1, min(commands.max_count, last - number + 1) + 1):
                    for steps in range(round(commands.delay_max / commands.delay_step) + 1):
                        yield Block(channel.name, number, steps * commands.delay_step, width, count)


def cheapest(body: nutdamp.Spacecraft, most: float) -> float:
    """The least propellant, kg, below ``most`` of one or two blocks that comply, else ``most``."""
    flow = {one.name: one.mass_flow or 0.0 for one in body.channels}

    def cost(block: Block) -> float:
        return flow[block.channel] * block.width * block.count

    sequences: list[tuple[float, tuple[Block, ...]]] = []
    for block in blocks_of(body, 1):
        if cost(block) < most:
            sequences.append((cost(block), (block,)))
            sequences += [
                (cost(block) + cost(other), (block, other))
                for other in blocks_of(body, block.first + block.count)
                if cost(block) + cost(other) < most
            ]
    for spent, sequence in sorted(sequences, key=lambda one: one[0]):
        try:
            made = fired(body, sequence)
            left = left_by(propagation.flown(body, made))
        except Infeasible:
            continue
        if made.end <= body.horizon and all(one.met for one in requirements.held(body, left)):
            return spent
    return most


@spread("seed", [79, 98, *range(79), *range(80, 98), *range(99, 200)], quick=0, deep=2)
def test_no_blocks_of_a_small_grid_are_cheaper(seed: int) -> None:
    body = grid(seed)
    plan = nutdamp.plan(body, "command-block", nutdamp.Options(max_blocks=2))
    if plan.meets_requirement:
        assert cheapest(body, 0.999 * present(plan.propellant)) == pytest.approx(
            0.999 * present(plan.propellant)
        )
    else:
        assert math.isinf(cheapest(body, math.inf))

"""Checks a certificate of ``plan --certificate`` from its numbers alone, without nutdamp."""

import json
import sys
from typing import Any

import numpy as np


def effects(c: dict[str, Any], t: np.ndarray) -> np.ndarray:
    """What a second of each channel at times t (n,) adds: (equations, n, channels)."""
    torques = np.array([one["torque_Nm"] for one in c["channels"]])
    across = torques[:, 0] + 1j * torques[:, 1]
    damped = np.exp(np.minimum(-c["growth_per_s"] * (t - c["last_s"]), 0.0))
    on_circle = torques[:, :2] @ (np.array(c["circle"]) * [1.0, 1.0j])
    nutation = (damped * np.exp(1j * c["nutation_rad_s"] * t))[:, None] * on_circle
    shift = np.exp(1j * c["spin_rad_s"] * t)[:, None] * across
    rows = {
        "nutation_1": nutation.real,
        "nutation_2": nutation.imag,
        "shift_1": shift.real,
        "shift_2": shift.imag,
    }
    return np.array(
        [
            (rows | {"spin": np.tile(torques[:, 2], (len(t), 1))})[one["name"]]
            for one in c["equations"]
        ]
    )


def check(text: str) -> float:
    """The bound that the file proves; raises AssertionError where it does not."""
    c = json.loads(text)
    goal, y = (np.array([one[key] for one in c["equations"]]) for key in ("goal_Nms", "price"))
    costs, once = (
        np.array([one[key] for one in c["channels"]]) for key in ("cost_per_s", "acts_at_once")
    )
    order = [one["name"] for one in c["channels"]]
    fastest = max(abs(c["spin_rad_s"]), abs(c["nutation_rad_s"]))
    gained = 0.0
    for begin, end in c[
        "windows_s"
    ]:  # so finely that q rises by less than 1e-5 between two moments
        t = np.linspace(begin, end, int((end - begin) * fastest * 250) + 2)
        over = np.tensordot(y, effects(c, t), 1) / costs - 1.0
        assert over[:, once].max(initial=0.0) < 2e-5, "q is above the price"
        gained += float(((np.maximum(over, 0.0) * costs)[:, ~once]).sum() * (t[1] - t[0]))
    assert gained <= c["gained"] * 1.001 + 1e-6 * c["bound"], "more is gained than is taken off"
    shift = np.linalg.norm([one["price"] for one in c["equations"] if "shift" in one["name"]])
    assert np.isclose(y @ goal - c["off_Nms"] * shift - c["gained"], c["bound"], rtol=1e-9), (
        "prices give another bound"
    )
    for primer in c["primer"]:
        q = np.tensordot(y, effects(c, np.array(primer["t_s"])), 1) / costs
        assert np.allclose(q, np.array([primer["q"][name] for name in order]).T, atol=1e-9), (
            "another curve"
        )
    reached = np.zeros(len(goal))
    spent = 0.0
    for burn in c["burns"]:
        at = order.index(burn["channel"])
        on_time = burn["on_time_s"]
        q = y @ effects(c, np.array([burn["t_s"]]))[:, 0, at] / costs[at]
        assert abs(q - burn["q"]) < 1e-9, "another price at a firing"
        assert q > 0.998, "fires below the price"
        wide = 0.0 if once[at] else on_time
        reached += (
            effects(c, burn["t_s"] + wide * np.linspace(-0.5, 0.5, 65))[:, :, at].mean(axis=1)
            * on_time
        )
        spent += costs[at] * on_time
    assert np.linalg.norm(reached - goal) <= c["off_Nms"] + 0.01 * np.linalg.norm(goal), (
        "the burns miss the goal"
    )
    assert np.isclose(spent, c["burns_cost"], rtol=1e-9)
    assert c["bound"] <= spent * (1.0 + 1e-9) <= c["bound"] * 1.005, (
        "the program costs more than the bound"
    )
    return float(c["bound"])


if __name__ == "__main__":
    print(check(open(sys.argv[1]).read()))  # noqa: SIM115, PTH123

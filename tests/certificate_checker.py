"""Checks a certificate of ``plan --certificate`` from its numbers alone: json and numpy, nothing of nutdamp."""

import json
import sys

import numpy as np


def check(text: str) -> float:
    """The bound that the file proves; raises AssertionError where it does not."""
    c = json.loads(text)
    goal, y = (np.array([one[key] for one in c["equations"]]) for key in ("goal_Nms", "price"))
    names = [one["name"] for one in c["equations"]]
    torques = np.array([one["torque_Nm"] for one in c["channels"]])
    costs = np.array([one["cost_per_s"] for one in c["channels"]])
    order, once = [one["name"] for one in c["channels"]], np.array([one["acts_at_once"] for one in c["channels"]])

    def adds(t: np.ndarray) -> np.ndarray:
        """What a second of each channel at times t (n,) adds to the equations, (equations, n, channels)."""
        damped = np.exp(np.minimum(-c["growth_per_s"] * (t - c["last_s"]), 0.0))
        sides = {"nutation": c["nutation_rad_s"], "shift": c["spin_rad_s"]}
        turned = {k: np.exp(1j * w * t)[:, None] * (torques[:, 0] + 1j * torques[:, 1]) for k, w in sides.items()}
        parts = {"nutation": turned["nutation"] * damped[:, None], "shift": turned["shift"]}
        rows = {f"{key}_{k}": part for key, z in parts.items() for k, part in ((1, z.real), (2, z.imag))}
        return np.array([(rows | {"spin": np.tile(torques[:, 2], (len(t), 1))})[name] for name in names])

    assert np.isclose(c["nutation_rad_s"], c["a"] * c["spin_rad_s"], rtol=1e-12)
    gained = 0.0
    for begin, end in c["windows_s"]:  # so finely that q rises by less than 1e-5 between two moments
        t = np.linspace(begin, end, int((end - begin) * max(abs(c["spin_rad_s"]), abs(c["nutation_rad_s"])) * 250) + 2)
        over = np.tensordot(y, adds(t), 1) / costs - 1.0
        assert over[:, once].max(initial=0.0) < 2e-5, "q is above the price"
        gained += float(((np.maximum(over, 0.0) * costs)[:, ~once]).sum() * (t[1] - t[0]))
    assert gained <= c["gained"] * 1.001 + 1e-6 * c["bound"], "more is gained than is taken off"
    off = c["off_Nms"] * np.hypot(*[price for name, price in zip(names, y) if "shift" in name] or [0.0, 0.0])  # noqa: B905
    assert np.isclose(y @ goal - off - c["gained"], c["bound"], rtol=1e-9), "the prices do not give the bound"
    for primer in c["primer"]:
        q = np.tensordot(y, adds(np.array(primer["t_s"])), 1) / costs
        assert np.allclose(q, np.array([primer["q"][name] for name in order]).T, atol=1e-9), "another curve"
    for burn in c["burns"]:
        q = (np.tensordot(y, adds(np.array([burn["t_s"]])), 1) / costs)[0, order.index(burn["channel"])]
        assert abs(q - burn["q"]) < 1e-9, "another price at a firing"
        assert q > 0.998, "fires below the price"
    reached = np.zeros(len(goal))
    for burn in c["burns"]:
        at = order.index(burn["channel"])
        wide = 0.0 if once[at] else burn["on_time_s"]
        reached += adds(burn["t_s"] + wide * np.linspace(-0.5, 0.5, 65))[:, :, at].mean(axis=1) * burn["on_time_s"]
    assert np.linalg.norm(reached - goal) <= c["off_Nms"] + 0.01 * np.linalg.norm(goal), "the burns miss the goal"
    spent = sum(costs[order.index(burn["channel"])] * burn["on_time_s"] for burn in c["burns"])
    assert np.isclose(spent, c["burns_cost"], rtol=1e-9)
    assert c["bound"] <= spent * (1.0 + 1e-9) <= c["bound"] * 1.005, "the program costs more than the bound"
    return float(c["bound"])


if __name__ == "__main__":
    print(check(open(sys.argv[1]).read()))  # noqa: SIM115, PTH123

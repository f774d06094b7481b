"""Checks the certificate of a robust plan from its numbers alone: json and numpy, nothing of nutdamp."""

import json
import sys
from typing import Any

import numpy as np


def added(c: dict[str, Any], kind: str, at: int, t: Any) -> tuple[Any, Any, Any]:
    """What a second of a channel at t (n,) leaves of a kind, (n,), and one sigma of each input, (n, d); the turn."""
    k, channel, growth = c["kinds"][kind], c["channels"][at], c["growth_per_s"] if kind == "nutation" else 0.0
    effect = complex(*k["channels"][channel["name"]]["effect_Nm"])
    changes = np.array(k["channels"][channel["name"]]["changes_Nm"]) @ [1, 1j]
    E = np.exp(1j * k["rate_rad_s"] * (t + channel["delay_s"]) + np.minimum(-growth * (t - c["last_s"]), 0.0))
    changed = E[:, None] * (changes + 1j * np.outer(t, k["rates_rad_s"]) * effect)
    return E * effect, changed, np.floor((t - c["earliest_s"]) / c["turn_s"]).astype(int)


def primer(c: dict[str, Any], t: Any) -> Any:
    """q of each channel at t (n,), (n, channels)."""
    q, own = np.zeros((len(t), len(c["channels"]))), np.array([one["each_pulse"] for one in c["inputs"]])
    for one in c["tangents"]:
        for at, channel in enumerate(c["channels"]):
            left, changed, turn = added(c, one["kind"], at, t)
            w = np.zeros((max(turn.max(), *(each["turn"] for each in one["each_pulse"]), 0) + 1, len(own)))
            for each in one["each_pulse"]:
                w[each["turn"]] += np.array(each["w"]) * (each["channel"] == channel["name"])
            moved = (changed * np.where(own, w[turn], one["shared"])).sum(axis=1)
            row = (np.conj(complex(*one["u"])) * (left + c["margin_sigmas"] * moved)).real
            q[:, at] -= one["price"] * row / channel["cost_per_s"]
    return q


def left_side(c: dict[str, Any], kind: str, u: Any) -> Any:
    """The left side of the cone of a kind in directions u (n,), after the firings of the file."""
    own, k = np.array([one["each_pulse"] for one in c["inputs"]]), c["kinds"][kind]
    pulses: dict[tuple[int, int], Any] = {}
    r, shared = -complex(*k["goal_Nms"]), np.array(k["start_Nms"]) @ [1, 1j]
    for one in c["firings"]:
        at = [channel["name"] for channel in c["channels"]].index(one["channel"])
        t = one["t_s"] + one["width_s"] * (np.arange(17) - 8.0) / 17
        left, changed, turn = added(c, kind, at, t)
        r, changed = r + left.mean() * one["on_time_s"], changed.mean(axis=0) * one["on_time_s"]
        shared = shared + np.where(own, 0.0, changed)
        pulses[at, turn[8]] = pulses.get((at, turn[8]), 0.0) + np.where(own, changed, 0.0)
    S = (np.conj(u)[:, None] * np.concatenate([shared, *pulses.values()])).real
    return (np.conj(u) * r).real + c["margin_sigmas"] * np.linalg.norm(S, axis=1)


def check(text: str) -> float:
    """The bound that the file proves; raises AssertionError where it does not."""
    c = json.loads(text)
    costs, once = (np.array([one[key] for one in c["channels"]]) for key in ("cost_per_s", "acts_at_once"))
    worth, gained, spent, order = 0.0, 0.0, 0.0, [one["name"] for one in c["channels"]]
    for one in c["tangents"]:
        u, k = complex(*one["u"]), c["kinds"][one["kind"]]
        w = np.concatenate([one["shared"], *(each["w"] for each in one["each_pulse"])])
        assert one["price"] >= 0.0, "a negative price"
        assert np.isclose(abs(u), 1.0) and w @ w <= 1.0 + 1e-9, "no tangent"  # noqa: PT018
        moved = c["margin_sigmas"] * (np.array(k["start_Nms"]) @ [1, 1j]) @ one["shared"]
        worth += one["price"] * ((np.conj(u) * (moved - complex(*k["goal_Nms"]))).real - k["most_Nms"])
    fastest = max(abs(c["spin_rad_s"]), abs(c["nutation_rad_s"]))
    for begin, end in c["windows_s"]:  # so finely that q rises by less than 1e-5 between two moments
        t = np.linspace(begin, end, int((end - begin) * fastest * 250) + 2)
        over = primer(c, t) - 1.0
        assert over[:, once].max(initial=0.0) < 2e-5, "q is above the price"
        gained += float(((np.maximum(over, 0.0) * costs)[:, ~once]).sum() * (t[1] - t[0]))
    assert gained <= c["gained"] * 1.001 + 1e-6 * c["bound"], "more is gained than is taken off"
    assert np.isclose(worth - c["gained"], c["bound"], rtol=1e-9), "prices give another bound"
    for one in c["primer"]:
        q = np.array([one["q"][name] for name in order]).T
        assert np.allclose(primer(c, np.array(one["t_s"])), q, atol=1e-9), "another curve"
    for one in c["firings"]:
        at = order.index(one["channel"])
        q = primer(c, np.array([one["t_s"]]))[0, at]
        assert abs(q - one["q"]) < 1e-9, "another price at a firing"
        assert q > 0.998, "fires below the price"
        assert once[at] or one["on_time_s"] <= one["width_s"] * (1.0 + 1e-9), "on for longer than there is time"
        spent += costs[at] * one["on_time_s"]
    for kind, k in c["kinds"].items():
        around = np.array([1.0, -1.0]) if kind == "spin" else np.exp(2j * np.pi * np.arange(720) / 720)
        assert left_side(c, kind, around).max() <= k["most_Nms"] * (1.0001 + min(c["passed"], 1e-3)), "a cone is broken"
    assert np.isclose(spent, c["firings_cost"], rtol=1e-9)
    assert c["bound"] <= spent * (1.0 + 1e-5) <= c["bound"] * 1.005, "the firings cost more than the bound"
    return float(c["bound"])


if __name__ == "__main__":
    print(check(open(sys.argv[1]).read()))  # noqa: SIM115, PTH123

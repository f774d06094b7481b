"""Random spacecraft with all kinds of limits and actuators, and random files, by seed."""

import math
from typing import Any

import numpy as np
from support.builders import channel, fan, spinner

from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Disturbance, Limits, Spacecraft


def power(rng: np.random.Generator, least: float, most: float) -> float:
    """Ten to a random power."""
    return float(10.0 ** rng.uniform(least, most))


def random_channels(rng: np.random.Generator, needed: float, period: float) -> tuple[Channel, ...]:
    """One to six, mostly transverse; on-times from a thousandth to a multiple of the need."""
    made = []
    for index in range(rng.integers(1, 7)):
        angle = rng.choice(
            [0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi, rng.uniform(-math.pi, math.pi)]
        )
        size = needed / (period * power(rng, -1.5, 0.5))
        torque = (
            size * math.cos(angle),
            size * math.sin(angle),
            size * float(rng.choice([0.0] * 3 + [0.05, -0.2, 1.5])),
        )
        shortest = period * power(rng, -4.0, -1.0) if rng.random() < 0.5 else 0.0
        longest = shortest + period * power(rng, -3.0, 0.0) if rng.random() < 0.5 else math.inf
        jet: dict[str, Any] = {"isp": 220.0 if rng.random() < 0.5 else None, "thrust": 1.0}
        times: dict[str, Any] = {"min_on_time": shortest, "max_on_time": longest}
        made.append(channel(f"T{index}", *torque, **times, **jet, force=(0.0, 0.0, 1.0)))
    return tuple(made)


def random_limits(rng: np.random.Generator, period: float, horizon: float) -> Limits:
    """Each limit in about half of the cases; blackouts overlap and come in any order."""
    end = horizon if rng.random() < 0.5 else period * power(rng, -1.0, 2.0)
    tick = rng.choice([1e-3, 0.01, 0.1, period * power(rng, -4.0, -0.5)])
    windows = [
        tuple(sorted(rng.uniform(0.0, min(end, 10 * period), 2).tolist()))
        for _ in range(rng.integers(0, 4))
    ]
    return Limits(
        horizon=None if end == horizon else end,
        earliest=end * float(rng.choice([0.0, 0.0, 0.1, rng.uniform(0.0, 0.9)])),
        gap=period * float(rng.choice([0.0, 0.0, 0.01, 0.3, 3.0])),
        tick=float(tick) if rng.random() < 0.5 else None,
        max_pulses=int(rng.integers(1, 10)) if rng.random() < 0.5 else None,
        blackout=tuple((begin, end) for begin, end in windows) if rng.random() < 0.5 else (),
    )


def random_spacecraft(rng: np.random.Generator) -> Spacecraft:
    """Prolate, oblate, sphere, disc, now and then triaxial; thrusters, a torquer, or both."""
    A = power(rng, -1.0, 4.0)
    usual = [rng.uniform(-0.99, 0.95), rng.uniform(-0.99, 0.95)]
    a = float(rng.choice([*usual, 0.0, -1.0, 0.25, 0.2, -1 / 3, 1e-3, -1e-9]))
    moments = (A, A, A * (1 - a))
    if rng.random() < 0.2 and abs(a) > 0.3 and a > -0.8:
        apart = rng.uniform(0.01, 0.15)  # still stable, and still a body
        moments = (A * (1 + apart), A * (1 - apart), A * (1 - a))
    spin = float(rng.choice([1.0, -1.0])) * power(rng, -1.0, 1.0)
    degrees = float(rng.choice([rng.uniform(0.01, 10.0), rng.uniform(1.0, 40.0)]))
    phase = float(rng.choice([0.0, 0.5 * math.pi, math.pi, rng.uniform(-math.pi, math.pi)]))
    plain = spinner(spin=spin, degrees=degrees, phase=phase, moments=moments)
    period = min(plain.body_period, plain.inertial_period)
    needed = plain.least_impulse
    torque = needed / (period * power(rng, -1.5, 0.5)) if rng.random() < 0.7 else None
    return spinner(
        spin=spin,
        degrees=degrees,
        phase=phase,
        moments=moments,
        channels=random_channels(rng, needed, period) if rng.random() < 0.8 else (),
        steerable=Steerable(torque) if rng.random() < 0.3 else None,
        limits=random_limits(rng, period, plain.horizon),
        mass=250.0,
    )


def disturbed_spacecraft(rng: np.random.Generator) -> Spacecraft:
    """Any disturbances, gaps, ticks and windows: alignments wander or never come."""
    A = power(rng, -1, 3)
    a = float(rng.choice([0.3, -0.5, 0.0, 1e-3, 0.9, -1.0]))
    spin, degrees = float(rng.choice([3.0, -0.2])), float(rng.choice([0.1, 5.0, 60.0]))
    plain = spinner(A, A * (1 - a), spin, degrees)
    period = min(plain.body_period, plain.inertial_period)
    torque = plain.least_impulse * plain.inertial_period
    size = plain.least_impulse / period
    turning = float(rng.choice([0.0, -spin, -plain.inertia.a * spin, rng.normal()]))
    torques = [
        Disturbance(power(rng, -4, 1) * size, 0.0, turning),
        Disturbance(0j, power(rng, -4, 0) * size * float(rng.choice([1.0, -1.0]))),
    ]
    ends = np.sort(rng.uniform(0.0, 20.0 * period, 8)).reshape(-1, 2)
    limits = Limits(
        horizon=power(rng, 0, 4) * period,
        gap=float(rng.choice([0.0, power(rng, -2, 1) * period])),
        earliest=float(rng.choice([0.0, 0.1 * period])),
        tick=float(rng.choice([1e-3, 0.3, 3.0])) * period if rng.random() < 0.3 else None,
        blackout=tuple((float(begin), float(end)) for begin, end in ends)
        if rng.random() < 0.5
        else (),
    )
    return Spacecraft(
        "disturbed",
        plain.inertia,
        plain.omega0,
        channels=fan(int(rng.integers(1, 6)), power(rng, -2, 1) * torque),
        limits=limits,
        disturbances=tuple(torques[: rng.integers(0, 3)]),
    )


EPOCH = "2026-03-01T12:00:00Z"
LAWS, KINDS = ("four-pulse", "one-pulse", "bang"), ("gyro", "accelerometer")


class Draws:
    """What a file holds, from a seed: a section by ``chance``, one of several, a number."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def pick(self, *values: Any) -> Any:
        return values[int(self.rng.integers(len(values)))]

    def between(self, least: float, most: float) -> float:
        return float(self.rng.uniform(least, most))


def equipped(seed: int) -> dict[str, Any]:
    """A valid spacecraft file as a dictionary: a body with jets, and any section."""
    draws = Draws(seed)
    A = power(draws.rng, 0.0, 3.5)
    ratio = draws.between(0.3, 1.8)
    spin = draws.pick(-1.0, 1.0) * power(draws.rng, -0.7, 0.7)
    if abs(ratio - 1.0) < 0.02:
        ratio += 0.05
    degrees = draws.pick(0.3, 2.0, 5.0, 12.0)
    arm = math.sqrt(A / 100.0)
    turn = 2.0 * math.pi / abs(spin)
    file: dict[str, Any] = {"name": f"spacecraft {seed}", "inertia": {"A": A, "C": ratio * A}}
    if draws.chance(0.2) and not 0.85 < ratio < 1.15:
        file["inertia"] = {"tensor": np.diag([A * 1.03, A * 0.97, ratio * A]).tolist()}
    phase = f"{draws.between(-180.0, 180.0)} deg"
    file["state"] = {
        "spin": f"{spin * 30.0 / math.pi} rpm",
        "nutation": f"{degrees} deg",
        "phase": phase,
    }
    if draws.chance(0.7):
        file["mass"] = f"{power(draws.rng, 1.6, 3.0)} kg"
    level = (
        A * spin * spin * ratio * math.tan(math.radians(degrees)) * draws.between(0.3, 3.0)
    )  # N m
    file["thrusters"] = _jets(draws, arm, level / arm, turn)
    if draws.chance(0.3):
        file["channels"] = {"+M1": ["T1"], "-M1": ["T2"], "+M2": ["T3"], "-M2": ["T4"]}
        if draws.chance(0.5):
            file["channels"]["axial"] = ["T1", "T2", "T3", "T4"]
    if draws.chance(0.15):
        file["steerable"] = draws.pick(
            {}, {"torque": level}, {"torque": level, "isp": 220, "lever_arm": arm}
        )
    if draws.chance(0.2):
        file["valve"] = _valve(draws, 0.01 * turn)
    _feed(draws, file)
    _surroundings(draws, file, level, turn)
    _demands(draws, file, degrees, turn)
    if draws.chance(0.35):
        file.get("tank", {}).pop("inertia_per_kg", None)  # a loop flies with constant moments
        file["loop"] = _loop(draws, degrees, turn, abs(spin), "+M1" if "channels" in file else "T1")
    if draws.chance(0.8):
        file["dispersions"] = _dispersions(draws, file, turn, abs(spin))
    return file


def _jets(draws: Draws, arm: float, force: float, turn: float) -> list[dict[str, Any]]:
    jets = []
    places = ([0, arm, 0], [0, -arm, 0], [-arm, 0, 0], [arm, 0, 0])
    timed = {"min_on_time": f"{2.0 * turn} ms", "max_on_time": f"{draws.pick(0.05, 0.3) * turn} s"}
    common: dict[str, Any] = {"isp": "220 s"} if draws.chance(0.7) else {}
    common |= timed if draws.chance(0.4) else {}
    bits = draws.chance(0.15)
    for number, place in enumerate(places, 1):
        one = {
            "name": f"T{number}",
            "position": place,
            "direction": [0, 0.01 * draws.pick(0, 1), 1],
            "force": f"{force} N",
        }
        jets.append({**one, **common})
        if bits:
            widths = [0.005 * turn, 0.02 * turn, 0.2 * turn]
            jets[-1]["impulse_bit"] = [
                [w, (w - 0.001 * turn) * force, 0.5 * w + 0.001 * turn] for w in widths
            ]
            jets[-1].pop("min_on_time", None)
            jets[-1].pop("max_on_time", None)
    if draws.chance(0.2):
        jets.append(
            {
                "name": "S",
                "position": [arm, 0, 0],
                "direction": [0, draws.pick(1, -1), 0],
                "force": f"{force} N",
                **common,
            }
        )
    return jets


def _valve(draws: Draws, size: float) -> dict[str, Any]:
    keys = ("open_delay", "close_delay", "rise_time", "fall_time")
    valve: dict[str, Any] = {
        key: f"{1e3 * draws.between(0.0, size)} ms" for key in keys if draws.chance(0.6)
    }
    if draws.chance(0.3):
        valve["on_time_is"] = draws.pick("command", "effective")
    return valve or {"open_delay": "1 ms"}


def _feed(draws: Draws, file: dict[str, Any]) -> None:
    """Cold nozzles and a tank, which needs to know what its thrusters use."""
    if draws.chance(0.2):
        file["cold"] = {"first": f"{draws.between(70.0, 99.0)} %", "pulses": draws.pick(1, 4, 10)}
    if draws.chance(0.3) and all("isp" in one for one in file["thrusters"]):
        tank: dict[str, Any] = {
            "propellant": f"{power(draws.rng, -1.0, 1.5)} kg",
            "pressure": "22 bar",
            "final_pressure": "8 bar",
        }
        if draws.chance(0.3):
            tank["exponent"] = draws.pick(0.8, 1, 1.2)
        if draws.chance(0.3):
            tank["isp"] = [["8 bar", "215 s"], ["22 bar", "228 s"]]
        if draws.chance(0.3):
            tank["inertia_per_kg"] = {"A": "0.01 kg m^2/kg", "C": "0.012 kg m^2/kg"}
        file["tank"] = tank


def _surroundings(draws: Draws, file: dict[str, Any], level: float, turn: float) -> None:
    """Attitude, Sun, cones, command blocks, disturbances, energy dissipation."""
    if draws.chance(0.55):
        quaternion = draws.rng.normal(size=4).tolist()
        file["attitude"] = {
            "quaternion": quaternion,
            "frame": draws.pick("EME2000", "J2000", "GCRF"),
            "epoch": EPOCH,
        }
        file["sun"] = draws.pick(
            "epoch", [f"{draws.between(0.0, 360.0)} deg", f"{draws.between(-20.0, 20.0)} deg"]
        )
        if draws.chance(0.4):
            file["keep"] = [{"name": "Sun", "direction": "sun", "min": "2 deg"}]
            if draws.chance(0.5):
                file["keep"].append(
                    {"name": "Earth", "direction": ["10 deg", "-30 deg"], "max": "179 deg"}
                )
        if draws.chance(0.5):
            file["sun_sensor"] = {"azimuth": f"{draws.between(0.0, 360.0)} deg"}
            if draws.chance(0.3):
                file["sun_sensor"] |= {
                    "elevation": "0 deg",
                    "half_width": "80 deg",
                    "jitter": "0.5 ms",
                }
            steps = draws.pick(
                [0.05 * turn, 0.1 * turn],
                {"step": 0.01 * turn, "min": 0.02 * turn, "max": 0.2 * turn},
            )
            file["commands"] = {
                "delay_step": 0.01 * turn,
                "delay_max": draws.pick(0.9, 1.2) * turn,
                "width": steps,
            }
            if draws.chance(0.5):
                file["commands"] |= {
                    "max_count": draws.pick(1, 20, 255),
                    "every": draws.pick([1], [1, 2]),
                }
        if draws.chance(0.2):
            file |= {
                "object_id": "2026-001A",
                "orbit": {"position": ["7000 km", 0, 0], "velocity": [0, "7.5 km/s", 0]},
            }
    if draws.chance(0.2):
        small = 1e-3 * level
        leak = {"name": "leak", "torque": [small, 0.0, draws.pick(0.0, 0.1 * small)]}
        turning = {"name": "drag", "torque": [small, small, 0.0], "fixed_in": "inertial"}
        file["disturbances"] = draws.pick([leak], [turning], [leak, turning])
    if draws.chance(0.2):
        file["dissipation"] = {"time_constant": f"{turn * power(draws.rng, 1.0, 4.0)} s"}
        if draws.chance(0.5):
            file["dissipation"]["nutation"] = draws.pick("grows", "decays")


def _demands(draws: Draws, file: dict[str, Any], degrees: float, turn: float) -> None:
    """Requirement, limits, goal."""
    if draws.chance(0.8):
        asked = {
            "nutation": f"{degrees * draws.pick(0.05, 0.3)} deg",
            "momentum_shift": f"{degrees} deg",
        }
        file["requirement"] = {
            key: angle for key, angle in asked.items() if key == "nutation" or draws.chance(0.4)
        }
        if draws.chance(0.5):
            file["requirement"]["probability"] = draws.pick("99.7 %", 0.9, "95 %")
    limits = {
        "horizon": f"{draws.pick(6.0, 20.0, 60.0) * turn} s",
        "earliest": f"{0.3 * turn} s",
        "gap": f"{0.1 * turn} s",
        "tick": f"{turn} ms",
        "max_pulses": draws.pick(2, 4, 20),
        "blackout": [[1.0 * turn, 1.5 * turn], [3.0 * turn, 3.2 * turn]],
    }
    file["limits"] = {key: value for key, value in limits.items() if draws.chance(0.3)}
    if not file["limits"]:
        del file["limits"]
    if draws.chance(0.15):
        file["goal"] = {
            "tilt": f"{draws.pick(1.0, 5.0, 30.0)} deg",
            "azimuth": f"{draws.between(0.0, 360.0)} deg",
        }
    elif draws.chance(0.1) and any(one["name"] == "S" for one in file["thrusters"]):
        file["goal"] = {
            "spin": f"{float(file['state']['spin'].split()[0]) * draws.pick(0.99, 1.01)} rpm"
        }


def _loop(draws: Draws, degrees: float, turn: float, spin: float, channel: str) -> dict[str, Any]:
    kind = draws.pick(*KINDS)
    sensor = dict[str, Any]()
    signal = 1e-3 * spin if kind == "gyro" else 1e-4 * spin * spin
    sensor["kind"] = kind
    if kind == "accelerometer":
        sensor |= {"position": ["0.8 m", 0, 0], "axis": [0, 0, 1]}
    some = {
        "noise": signal,
        "quantisation": 0.3 * signal,
        "bias": signal,
        "scale": "101 %",
        "delay": 0.01 * turn,
    }
    if kind == "accelerometer" or draws.chance(0.7):  # else a continuous signal
        sensor |= {key: value for key, value in some.items() if draws.chance(0.4)}
        sensor["rate"] = f"{draws.pick(40.0, 100.0) / turn} Hz"
        if draws.chance(0.3):
            sensor["low_pass"] = 0.01 * turn
    law = draws.pick(*LAWS)
    loop: dict[str, Any] = {
        "sensor": sensor,
        "law": law,
        "start": f"{0.5 * degrees} deg",
        "stop": f"{0.1 * degrees} deg",
    }
    if law == "bang" or (law == "four-pulse" and draws.chance(0.2)):
        loop["on_time"] = 0.02 * turn
    more = {
        "settle": 0.05 * turn,
        "min_interval": 0.1 * turn,
        "predict": False,
        "faults": {"reversed": [channel]},
    }
    return loop | {key: value for key, value in more.items() if draws.chance(0.2)}


def _dispersions(draws: Draws, file: dict[str, Any], turn: float, spin: float) -> dict[str, Any]:
    """Of what the file has, in any kind of distribution."""

    def spread(size: float, unit: str) -> dict[str, str]:
        return {draws.pick("normal", "uniform", "triangular", "bias"): f"{size} {unit}".strip()}

    known = {
        "A": spread(0.5, "%"),
        "C": spread(0.5, "%"),
        "omega0": {"normal": f"{1e-3 * spin} rad/s"},
        "thrust": spread(2.0, "%"),
        "thrust_per_pulse": spread(1.0, "%"),
        "thrust_direction": spread(0.3, "deg"),
        "position": spread(3.0, "mm"),
        "timing": spread(turn, "ms"),
        "timing_offset": {"bias": f"{turn} ms"},
        "attitude": spread(0.2, "deg"),
    }
    if "valve" in file and not any("impulse_bit" in one for one in file["thrusters"]):
        times = {
            key: float(time.split()[0])
            for key, time in file["valve"].items()
            if key != "on_time_is"
        }  # ms
        known |= {key: spread(min(0.2 * turn, 0.3 * time), "ms") for key, time in times.items()}
    if any("impulse_bit" in one for one in file["thrusters"]):
        known["impulse_bit"] = spread(2.0, "%")
    if "cold" in file:
        known |= {"cold": spread(1.0, "%"), "cold_pulses": spread(10.0, "%")}
    if "tank" in file:
        known |= {
            "tank_propellant": spread(1.0, "%"),
            "tank_pressure": spread(0.2, "bar"),
            "tank_exponent": spread(5.0, "%"),
        }
    if "loop" in file:
        known |= {"sensor_scale": spread(1.0, "%"), "sensor_delay": spread(0.1 * turn, "ms")}
    chosen: dict[str, Any] = {key: value for key, value in known.items() if draws.chance(0.5)} or {
        "A": known["A"]
    }
    if (
        {"A", "C"} <= set(chosen)
        and not {"bias"} & {*chosen["A"], *chosen["C"]}
        and "A" in file["inertia"]
    ):
        chosen["correlation"] = [["A", "C", draws.pick(0.9, -0.5)]]
    return chosen

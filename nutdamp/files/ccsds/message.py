"""Tables of the messages on attitude and orbit: the fields of each block, in their order.

They are those of CCSDS 504.0-B-2: 3-1 to 3-3 (APM), 4-2 to 4-4 (AEM), 5-2 to 5-5 (ACM), 7-3 and 7-5
(tags in XML); of CCSDS 502.0-B-3: 3-1 to 3-3 (OPM); and of attitude files of the Systems Tool Kit
(`.a`). Writers and the reader share them.
"""

from __future__ import annotations

from typing import NamedTuple

from nutdamp.common.time import UNIFORM

VERSION = "2.0"  # of APM, AEM and ACM in issue 2 of their standard; version 1 has other keywords

BODY_FRAME = "SC_BODY_1"


class Keyword(NamedTuple):
    """One row of a table: its unit (None of texts), whether it must be there, the XML tag besides
    the block's, the ``words`` of which it is one, and its ``kind``.

    Kinds: ``epoch``, ``date``, ``system`` (of time), ``frame``, ``body`` (frame fixed in it),
    ``sequence`` (of turns), ``vector``, ``above`` or ``most`` 0; else a text, or a number where
    there is a unit.
    """

    name: str
    unit: str | None = None
    required: bool = True
    tag: str = ""
    kind: str = ""
    words: tuple[str, ...] = ()


class Layout(NamedTuple):
    """A block: its tag in XML, its keywords in their order, and how often it may come.

    ``rows``: lines of data below the keywords. ``skipped``: its contents are not read.
    """

    tag: str
    keywords: tuple[Keyword, ...] = ()
    repeated: bool = False
    rows: bool = False
    skipped: bool = False


def _rows(
    *names: str, unit: str | None = None, required: bool = True, tag: str = "", kind: str = ""
) -> tuple[Keyword, ...]:
    return tuple(Keyword(name, unit, required, tag, kind) for name in names)


_ENDPOINTS = _rows("REF_FRAME_A", "REF_FRAME_B", kind="frame")
_SYSTEM = Keyword("TIME_SYSTEM", kind="system", words=("UTC", *UNIFORM))
_SEQUENCE = Keyword("EULER_ROT_SEQ", kind="sequence")
QUATERNION = _rows("Q1", "Q2", "Q3", "QC", unit="", tag="quaternion")
ANGLES = _rows("ANGLE_1", "ANGLE_2", "ANGLE_3", unit="deg")
ANGVEL = _rows("ANGVEL_X", "ANGVEL_Y", "ANGVEL_Z", unit="deg/s", tag="angVel")
SPIN_AXIS = (
    *_rows("SPIN_ALPHA", "SPIN_DELTA", "SPIN_ANGLE", unit="deg"),
    *_rows("SPIN_ANGLE_VEL", unit="deg/s"),
)
NUTATION = (
    *_rows("NUTATION", unit="deg"),
    *_rows("NUTATION_PER", unit="s", kind="above"),
    *_rows("NUTATION_PHASE", unit="deg"),
)
# Direction of H, and rate of the spin axis about it.
MOMENTUM = (
    *_rows("MOMENTUM_ALPHA", "MOMENTUM_DELTA", unit="deg"),
    *_rows("NUTATION_VEL", unit="deg/s"),
)
TORQUE = _rows("MAN_TOR_X", "MAN_TOR_Y", "MAN_TOR_Z", unit="N*m")
INERTIA = _rows("IXX", "IYY", "IZZ", "IXY", "IXZ", "IYZ", unit="kg*m**2")


def names(keywords: tuple[Keyword, ...]) -> tuple[str, ...]:
    """Names of keywords."""
    return tuple(keyword.name for keyword in keywords)


def _optional(keywords: tuple[Keyword, ...]) -> tuple[Keyword, ...]:
    return tuple(keyword._replace(required=False) for keyword in keywords)


HEADER = (
    *_rows("CLASSIFICATION", required=False),
    *_rows("CREATION_DATE", "ORIGINATOR"),
    *_rows("MESSAGE_ID", required=False),
)

APM_METADATA = (
    *_rows("OBJECT_NAME", "OBJECT_ID"),
    *_rows("CENTER_NAME", required=False),
    _SYSTEM,
)

APM_BLOCKS: dict[str, Layout] = {
    "QUAT": Layout(
        "quaternionState",
        (
            *_ENDPOINTS,
            *QUATERNION,
            *_rows(
                *("Q1_DOT", "Q2_DOT", "Q3_DOT", "QC_DOT"),
                unit="1/s",
                required=False,
                tag="quaternionDot",
            ),
        ),
    ),
    "EULER": Layout(
        "eulerAngleState",
        (
            *_ENDPOINTS,
            _SEQUENCE,
            *ANGLES,
            *_rows("ANGLE_1_DOT", "ANGLE_2_DOT", "ANGLE_3_DOT", unit="deg/s", required=False),
        ),
    ),
    "ANGVEL": Layout(
        "angularVelocity",
        (
            *_ENDPOINTS,
            *_rows("ANGVEL_FRAME", kind="frame"),
            *_rows(*names(ANGVEL), unit="deg/s"),
        ),
    ),
    "SPIN": Layout("spin", (*_ENDPOINTS, *SPIN_AXIS, *_optional(NUTATION), *_optional(MOMENTUM))),
    "INERTIA": Layout("inertia", (*_rows("INERTIA_REF_FRAME", kind="body"), *INERTIA)),
    "MAN": Layout(
        "maneuverParameters",
        (
            *_rows("MAN_EPOCH_START", kind="epoch"),
            *_rows("MAN_DURATION", unit="s", kind="above"),
            *_rows("MAN_REF_FRAME", kind="body"),
            *TORQUE,
            *_rows("MAN_DELTA_MASS", unit="kg", required=False, kind="most"),
        ),
        repeated=True,
    ),
}
"""The blocks of an APM's data, in their order."""

APM_GROUPS = {
    "QUAT": QUATERNION,
    "EULER": ANGLES,
    "ANGVEL": ANGVEL,
    "SPIN": SPIN_AXIS,
    "INERTIA": INERTIA,
    "MAN": TORQUE,
}
"""Numbers without which a block tells nothing."""

OPM_METADATA = _rows("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM")

OPM_BLOCKS: dict[str, Layout] = {
    "STATE": Layout(
        "stateVector",
        (
            *_rows("EPOCH"),
            *_rows("X", "Y", "Z", unit="km"),
            *_rows("X_DOT", "Y_DOT", "Z_DOT", unit="km/s"),
        ),
    ),
    "SPACECRAFT": Layout("spacecraftParameters", _rows("MASS", unit="kg", required=False)),
    "MANEUVER": Layout(
        "maneuverParameters",
        (
            *_rows("MAN_EPOCH_IGNITION"),
            *_rows("MAN_DURATION", unit="s"),
            *_rows("MAN_DELTA_MASS", unit="kg"),
            *_rows("MAN_REF_FRAME"),
            *_rows("MAN_DV_1", "MAN_DV_2", "MAN_DV_3", unit="km/s"),
        ),
    ),
}
"""Keywords written in the blocks of an OPM, in their order; the names of the blocks are not in the
message.
"""

LAYOUTS = {**APM_BLOCKS, **OPM_BLOCKS}


_EPOCH = _rows("EPOCH", kind="epoch")
QUATERNION_ANGVEL, SPIN, SPIN_NUTATION_MOM = "QUATERNION/ANGVEL", "SPIN", "SPIN/NUTATION_MOM"
AEM_RECORDS = {
    "QUATERNION": Layout("quaternionEphemeris", (*_EPOCH, *QUATERNION)),
    QUATERNION_ANGVEL: Layout("quaternionAngVel", (*_EPOCH, *QUATERNION, *ANGVEL)),
    "EULER_ANGLE": Layout("eulerAngle", (*_EPOCH, *ANGLES)),
    "EULER_ANGLE/ANGVEL": Layout("eulerAngleAngVel", (*_EPOCH, *ANGLES, *ANGVEL)),
    SPIN: Layout("spin", (*_EPOCH, *SPIN_AXIS)),
    "SPIN/NUTATION": Layout("spinNutation", (*_EPOCH, *SPIN_AXIS, *NUTATION)),
    SPIN_NUTATION_MOM: Layout("spinNutationMom", (*_EPOCH, *SPIN_AXIS, *MOMENTUM)),
}
"""A data line of each ATTITUDE_TYPE (table 4-4)."""

AEM_METADATA = (
    *_rows("OBJECT_NAME", "OBJECT_ID"),
    *_rows("CENTER_NAME", required=False),
    *_ENDPOINTS,
    _SYSTEM,
    *_rows("START_TIME", kind="epoch"),
    *_rows("USEABLE_START_TIME", "USEABLE_STOP_TIME", required=False, kind="epoch"),
    *_rows("STOP_TIME", kind="epoch"),
    Keyword("ATTITUDE_TYPE", words=tuple(AEM_RECORDS)),
    _SEQUENCE._replace(required=False),
    *_rows("ANGVEL_FRAME", required=False, kind="frame"),
    *_rows("INTERPOLATION_METHOD", "INTERPOLATION_DEGREE", required=False),
)

ACM_ATTITUDES = {"QUATERNION": QUATERNION, "EULER_ANGLES": ANGLES}
"""First columns behind the time in lines of an ACM, by ATT_TYPE."""

ACM_RATES = {
    "NONE": (),
    "ANGVEL": ANGVEL,
    "GYRO_BIAS": _rows("GYRO_BIAS_X", "GYRO_BIAS_Y", "GYRO_BIAS_Z", unit="deg/s"),
    "Q_DOT": _rows("Q1_DOT", "Q2_DOT", "Q3_DOT", "QC_DOT", unit="1/s"),
}
"""The columns after them, by RATE_TYPE."""

ACM_BLOCKS: dict[str, Layout] = {
    "META": Layout(
        "metadata",
        (
            *_rows("CLASSIFICATION", required=False),
            *_rows("OBJECT_NAME"),
            *_rows(
                *("INTERNATIONAL_DESIGNATOR", "CATALOG_NAME", "OBJECT_DESIGNATOR"),
                *("ORIGINATOR_POC", "ORIGINATOR_POSITION", "ORIGINATOR_PHONE"),
                *("ORIGINATOR_EMAIL", "ORIGINATOR_ADDRESS", "ODM_MSG_LINK", "CENTER_NAME"),
                required=False,
            ),
            _SYSTEM,
            *_rows("EPOCH_TZERO", kind="epoch"),
            *_rows("ACM_DATA_ELEMENTS", "START_TIME", "STOP_TIME", required=False),
            *_rows("TAIMUTC_AT_TZERO", unit="s", required=False),
            *_rows("NEXT_LEAP_EPOCH", required=False),
            *_rows("NEXT_LEAP_TAIMUTC", unit="s", required=False),
        ),
    ),
    "ATT": Layout(
        "att",
        (
            *_rows("ATT_ID", "ATT_PREV_ID", "ATT_BASIS", "ATT_BASIS_ID", required=False),
            *_ENDPOINTS,
            *_rows("NUMBER_STATES", unit=""),
            Keyword("ATT_TYPE", words=tuple(ACM_ATTITUDES)),
            _SEQUENCE._replace(required=False),
            Keyword("RATE_TYPE", required=False, words=tuple(ACM_RATES)),
        ),
        repeated=True,
        rows=True,
    ),
    "PHYS": Layout(
        "phys",
        (
            *_rows("DRAG_COEFF", unit="", required=False),
            *_rows("WET_MASS", "DRY_MASS", unit="kg", required=False, kind="above"),
            *_rows("CP_REF_FRAME", required=False),
            Keyword("CP", "m", required=False, kind="vector"),
            *_rows("INERTIA_REF_FRAME", required=False, kind="body"),
            *_optional(INERTIA),
        ),
    ),
    "COV": Layout("cov", repeated=True, skipped=True),
    "MAN": Layout("man", repeated=True, skipped=True),
    "AD": Layout("ad", skipped=True),
    "USER": Layout("user", skipped=True),
}
"""The blocks of an ACM, in their order."""

STK_KEYWORDS = (
    *_rows("NumberOfAttitudePoints", unit=""),
    *_rows("ScenarioEpoch", kind="date"),
    Keyword("CoordinateAxes", kind="frame", words=("J2000", "ICRF")),
    Keyword("TimeFormat", required=False, words=("EpSec",)),
    *_rows(
        *("CentralBody", "BlockingFactor", "InterpolationOrder", "InterpolationMethod"),
        *("MessageLevel", "CoordinateAxesEpoch"),
        required=False,
    ),
)

STK_ROWS = {
    "AttitudeTimeQuaternions": QUATERNION,
    "AttitudeTimeQuatScalarFirst": (QUATERNION[3], *QUATERNION[:3]),
    "AttitudeTimeQuatAngVels": (*QUATERNION, *ANGVEL),
}
"""Columns behind the time in an attitude file of the Systems Tool Kit, by the line before them."""


class Form(NamedTuple):
    """A message that is read: its keywords outside of blocks, and its blocks in their order."""

    name: str
    outside: tuple[Keyword, ...]
    blocks: dict[str, Layout]


FORMS = {
    f"CCSDS_{form.name}_VERS": form
    for form in (
        Form("APM", (*HEADER, *APM_METADATA, *_EPOCH), APM_BLOCKS),
        Form(
            "AEM",
            HEADER,
            {
                "META": Layout("metadata", AEM_METADATA, repeated=True),
                "DATA": Layout("data", repeated=True, rows=True),
            },
        ),
        Form("ACM", HEADER, ACM_BLOCKS),
    )
}
"""Messages that are read, by the keyword of their first line."""

"""The kinds of values in a spacecraft file: quantities with their ranges, lists of them, names, dates, counts."""

from __future__ import annotations

import datetime
import re
from typing import Annotated

from pydantic import AfterValidator, Field, Strict

from nutdamp.files.fields import RIGHT_ANGLE, AxialShorthand, Quantity
from nutdamp.units import shown


def _epoch(text: str) -> str:
    """Refuses what is not a date and a time; their text is passed on as it is."""
    try:
        if not re.fullmatch(_EPOCH, text):
            raise ValueError
        datetime.datetime.fromisoformat(text)
    except ValueError:
        example = "2026-03-01T12:00:00Z"
        raise ValueError(f"{shown(text)} is no epoch; expected ISO 8601 with date and time: {example}") from None
    return text


_EPOCH = r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}(:[0-9]{2}(\.[0-9]+)?)?(Z|[+-][0-9]{2}:[0-9]{2})?"

Mass = Annotated[float, Quantity("mass", exclusiveMinimum=0)]
Moment = Annotated[float, Quantity("inertia", exclusiveMinimum=0)]
Rate = Annotated[float, Quantity("rate")]
Angle = Annotated[float, Quantity("angle")]
Nutation = Annotated[float, Quantity("angle", minimum=0, exclusiveMaximum=RIGHT_ANGLE)]
Tilt = Annotated[float, Quantity("angle", minimum=0, exclusiveMaximum=2 * RIGHT_ANGLE)]
Declination = Annotated[float, Quantity("angle", minimum=-RIGHT_ANGLE, maximum=RIGHT_ANGLE)]
AcuteAngle = Annotated[float, Quantity("angle", exclusiveMinimum=0, exclusiveMaximum=RIGHT_ANGLE)]
Time = Annotated[float, Quantity("time", minimum=0)]
PositiveTime = Annotated[float, Quantity("time", exclusiveMinimum=0)]
Force = Annotated[float, Quantity("force", exclusiveMinimum=0)]
Lever = Annotated[float, Quantity("length", exclusiveMinimum=0)]
Torque = Annotated[float, Quantity("torque", exclusiveMinimum=0)]
Probability = Annotated[float, Quantity("ratio", exclusiveMinimum=0, exclusiveMaximum=1)]

_THREE = Field(min_length=3, max_length=3)
Rates = Annotated[list[Rate], _THREE]
Position = Annotated[list[Annotated[float, Quantity("length")]], _THREE]
Velocity = Annotated[list[Annotated[float, Quantity("speed")]], _THREE]
Direction = Annotated[list[Annotated[float, Quantity("number")]], _THREE]
Torques = Annotated[list[Annotated[float, Quantity("torque")]], _THREE]
DisturbingTorques = Annotated[Torques, AxialShorthand()]
Tensor = Annotated[list[Annotated[list[Annotated[float, Quantity("inertia")]], _THREE]], _THREE]
Quaternion = Annotated[list[Annotated[float, Quantity("number")]], Field(min_length=4, max_length=4)]
InTheSky = Annotated[list[Angle], Field(min_length=2, max_length=2)]
Apart = Annotated[float, Quantity("angle", minimum=0, maximum=2 * RIGHT_ANGLE)]
Window = Annotated[list[Time], Field(min_length=2, max_length=2)]
Name = Annotated[str, Field(min_length=1)]
Epoch = Annotated[str, AfterValidator(_epoch), Field(json_schema_extra={"pattern": f"^{_EPOCH}$"})]
Count = Annotated[int, Strict(), Field(ge=1, le=1_000_000)]

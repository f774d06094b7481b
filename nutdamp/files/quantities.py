"""The kinds of values in a spacecraft file: quantities with their ranges, lists of them, names, dates, counts."""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable
from typing import Annotated, Any

from nutdamp.files.fields import RIGHT_ANGLE, AxialShorthand, Quantity
from nutdamp.files.sections import Length, Rule, Within
from nutdamp.units import shown


class _DateAndTime(Rule):
    """Annotation of a text that is a date and a time."""

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """The text as it is; raises ValueError for what is no date and time."""
        text = inner(value)
        try:
            if text is not None:
                if not re.fullmatch(_EPOCH, text):
                    raise ValueError
                datetime.datetime.fromisoformat(text)
        except ValueError:
            example = "2026-03-01T12:00:00Z"
            raise ValueError(f"{shown(text)} is no epoch; expected ISO 8601 with date and time: {example}") from None
        return text

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """A text of that form."""
        return {**inner(), "pattern": f"^{_EPOCH}$"}


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

_THREE = Length(3, 3)
Rates = Annotated[list[Rate], _THREE]
Position = Annotated[list[Annotated[float, Quantity("length")]], _THREE]
Velocity = Annotated[list[Annotated[float, Quantity("speed")]], _THREE]
Direction = Annotated[list[Annotated[float, Quantity("number")]], _THREE]
Torques = Annotated[list[Annotated[float, Quantity("torque")]], _THREE]
DisturbingTorques = Annotated[Torques, AxialShorthand()]
Tensor = Annotated[list[Annotated[list[Annotated[float, Quantity("inertia")]], _THREE]], _THREE]
Quaternion = Annotated[list[Annotated[float, Quantity("number")]], Length(4, 4)]
InTheSky = Annotated[list[Angle], Length(2, 2)]
Apart = Annotated[float, Quantity("angle", minimum=0, maximum=2 * RIGHT_ANGLE)]
Window = Annotated[list[Time], Length(2, 2)]
Name = Annotated[str, Length(1)]
Epoch = Annotated[str, _DateAndTime()]
Count = Annotated[int, Within(1, 1_000_000)]

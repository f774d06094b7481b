"""A body with requirement and tolerances whose schemes, trades and dispersed cases are drawn."""

import math
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from support.builders import cross, spinner
from support.dispersed import normal

from nutdamp.spacecraft.model import Limits, Requirement, Vector
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance

REQUIRED = Requirement(math.radians(0.5), math.radians(0.2), 0.997)
TOLERANCES = Dispersions(
    A=normal(0.005, relative=True),
    C=normal(0.005, relative=True),
    omega0=(normal(0.002),) * 3,
    thrust=dict.fromkeys(("+1", "-1", "+2", "-2"), normal(0.02, relative=True)),
    timing=Tolerance("uniform", 0.005),
    timing_offset=Tolerance("bias", 0.002),
    attitude=normal(0.002),
)
BODY = replace(
    spinner(channels=cross(8.0, min_on_time=0.02, max_on_time=2.0), requirement=REQUIRED, limits=Limits(horizon=40.0)),
    dispersions=TOLERANCES,
)


def line(axes: Axes, label: str) -> Vector:
    (found,) = (one for one in axes.lines if str(one.get_label()).startswith(label))
    return np.asarray(found.get_xydata(), dtype=np.float64)

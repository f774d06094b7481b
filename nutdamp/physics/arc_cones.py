"""The cone angles by which a torque-free arc is judged, for bodies with two equal moments and with three."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nutdamp.physics.cones import Cones, momentary


def arc_cones(moments: tuple[float, float, float], rates: ArrayLike, sense: float) -> Cones:
    """The cones at the instant of largest nutation on the torque-free motion through ``rates`` (3,) rad/s.

    With I1 = I2 they stay what they are; else θ swings between two values while H is fixed in space. The spin
    axis is ``sense``·e3.
    """
    if moments[0] == moments[1]:
        return momentary(moments, rates, sense)
    from nutdamp.physics import triaxial  # a body of three moments needs it, and few flights are of one

    return triaxial.widest_cones(moments, np.asarray(rates, dtype=float), sense)

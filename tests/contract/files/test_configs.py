"""Every file in configs/ says where its figures come from, loads, and is planned with a sensible answer."""

from __future__ import annotations

import math
from pathlib import Path

from support import places
from support.cases import spread
from support.contract import known

from nutdamp.comparison import compare
from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.remarks import broken_limits, infeasibility
from nutdamp.schemes import CLASSIC

FILES = sorted(places.CONFIGS.glob("*.yaml"))


def test_they_name_their_sources() -> None:
    assert len(FILES) >= 8
    for path in FILES:
        comment = [line for line in path.read_text(encoding="utf-8").splitlines()[:30] if line.startswith("#")]
        assert len(comment) >= 3
        assert any("assumed" in line.lower() for line in comment)


@spread("path", FILES, quick=4, deep=len(FILES), ids=lambda path: str(path.stem))
def test_it_is_planned(path: Path) -> None:
    spacecraft = load_spacecraft(path)
    compared = compare(spacecraft, CLASSIC)
    best = compared.recommended
    assert known(known(best).flown).nutation < 0.1 * spacecraft.nutation
    assert known(best).meets_requirement is not False
    for plan in compared.plans:
        assert plan.feasible or infeasibility(plan)
        assert broken_limits(spacecraft, plan.pulses) == []
        if plan.feasible and spacecraft.inertia.symmetric and plan.residual is not None:
            # Nothing beats the floor down to what is left: A|ω0| - C|ω3| tan θ.
            left = spacecraft.inertia.C * abs(spacecraft.spin) * math.tan(plan.residual.nutation)
            assert plan.pulses.total_impulse >= (spacecraft.least_impulse - left) * (1 - 1e-3)

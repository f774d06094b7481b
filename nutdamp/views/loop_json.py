"""Results of ``loop --json`` and ``verify --loop --json``."""

from __future__ import annotations

import math
from typing import Any

from nutdamp.control_loop.evaluation import LoopPlan, LoopVerification
from nutdamp.control_loop.stability import Margin
from nutdamp.views.plan_json import final_json, heading, requirement_json, residual_json, target_json
from nutdamp.views.pulses import pulse_table


def loop_json(plan: LoopPlan) -> dict[str, Any]:
    """Firings with the nutation seen, final motion, dead band, and margin of each channel before it feeds."""
    run, body = plan.flown_run, plan.spacecraft
    seen = [{"decided_s": firing.decided, "seen_deg": math.degrees(firing.seen)} for firing in run.fired]
    return {
        **heading(body),
        "law": run.loop.law,
        "seed": run.seed,
        "case": run.case,
        "until_s": run.until,
        "stopped": run.stop.name.lower(),
        "channel": run.channel,
        "meets_requirement": False if run.stop.fault else plan.meets_requirement,
        "requirement": requirement_json(plan),
        "quiet_s": list(run.quiet),
        "largest_since_quiet_deg": None if run.settled is None else math.degrees(plan.largest[0]),
        "dead_band_deg": math.degrees(plan.band.most),
        "pulses": [{**pulse, **more} for pulse, more in zip(pulse_table(run.flight).json("flown"), seen, strict=True)],
        "total_impulse_Nms": plan.total_impulse,
        "propellant_kg": plan.propellant,
        "end_s": plan.end,
        "flown": residual_json(plan.flight.residual),
        "final": final_json(plan.flight),
        "target": target_json(body),
        "margins": margins_json(plan.margins),
    }


def verified_json(verification: LoopVerification) -> dict[str, Any]:
    """The object of ``verify --loop --json``: of each firing the difference by DOP853."""
    run = verification.run
    return {
        **heading(run.spacecraft),
        "scheme": "loop",
        "agree": None if verification.missing else verification.agree,
        "missing": verification.missing or None,
        "evaluations": verification.evaluations,
        "until_s": run.until,
        "firings": [
            {
                "channel": firing.pulse.channel,
                "start_s": firing.pulse.loaded[0],
                "on_time_s": firing.pulse.loaded[1],
                "start_difference_s": start,
                "on_time_difference_s": lasts,
                "nutation_difference_deg": math.degrees(nutation),
            }
            for firing, (start, lasts, nutation) in zip(run.fired, verification.pairs, strict=False)
        ],
    }


def margins_json(margins: tuple[Margin, ...]) -> list[dict[str, Any]]:
    """Margin of each channel before it feeds the nutation, at the start threshold."""
    return [
        {
            "channel": margin.channel,
            "late_deg": math.degrees(margin.late),
            "latest_deg": math.degrees(margin.latest) if math.isfinite(margin.latest) else None,
            "gain": margin.gain,
            "growth": margin.growth,
            "delay_margin_s": margin.delay if math.isfinite(margin.delay) else None,
            "damps": margin.damps,
            "reversed": margin.cause.turned,
        }
        for margin in margins
    ]

"""The schemes: how each works, when to use it, its options and its limits."""

from __future__ import annotations

from nutdamp.guide.topic import Block, Formula, Part, Rows, Topic

_ON_TIME = "length of its pulses, such as 200ms"
_DISTURBED = ("--with-disturbances", "plan on the motion with the disturbances of the file, as every scheme can")
_TARGET = ("--target A,B", "where the spin axis is to end: right ascension and declination, or tilt and azimuth")


def _scheme(
    name: str,
    summary: str,
    how: tuple[Block, ...],
    formula: tuple[str, ...],
    meaning: str,
    use: str,
    options: tuple[tuple[str, str], ...],
    limits: tuple[str, ...],
    see: str,
) -> Topic:
    return Topic(
        name,
        summary,
        (
            Part("How it works", how),
            Part("Equation", (Formula(formula), meaning)),
            Part("When to use it", (use,)),
            Part("Options of nutdamp plan", (Rows((*options, _DISTURBED)),)),
            Part("Limits", limits),
            Part("See also", (see,)),
        ),
    )


SCHEMES = (
    _scheme(
        "one-pulse",
        "all at once against ω; H moves to the spin axis",
        (
            "One transverse pulse against ω removes the whole nutation: H jumps onto the spin axis, which stops where "
            "it is. A steerable torquer fires at once; a body-fixed channel waits until its torque points against ω.",
            "Where the torque is too weak or the longest on-time too short, a train of equal pulses does it, each at "
            "the next moment at which the channel opposes ω.",
        ),
        ("J = A|ω|", "on-time = (2/(aω3)) asin(aω3 A|ω|/(2M))"),
        "J N m s, A kg m², |ω| transverse rate rad/s, a = (A - C)/A, ω3 spin rad/s, M torque N m. The on-time leaves "
        "no ω at all in spite of the width of the pulse; for a -> 0 it is A|ω|/M.",
        "Where the spin axis may end anywhere and impulse counts: ideal, it costs A|ω0|, the least there is.",
        (),
        (
            "H turns by θ0, the nutation angle at the start (a long pulse or a train turns it less).",
            "It does not go to a target axis.",
            "Near a sphere ω hardly turns in the body: fixed channels may wait beyond the horizon.",
        ),
        "explain 21, explain two-pulse",
    ),
    _scheme(
        "two-pulse",
        "two pulses half a nutation turn apart; H ends where it was, or on a target",
        (
            "The first pulse, against ω, halves the nutation angle: H jumps half-way towards the spin axis. Half an "
            "inertial nutation turn later the spin axis stands where H was at the start; the second pulse brings H "
            "back there, and nothing nutates. Any odd number of half turns does as well, and lets fixed channels come "
            "into line.",
            "Of body-fixed channels every pair and wait is looked at. Where the second channel misses the right "
            "direction by ψ both still damp, at 1/cos(ψ/2) times the impulse. The pulses are corrected on the flight "
            "through their real widths.",
            "With --target, or a goal in the file, two pulses bring H and the spin axis there: H jumps to where the "
            "cone leads the spin axis over the target, and jumps onto it when the axis comes by.",
        ),
        (
            "J1 = C|ω3| (tan θ - tan(θ/2))",
            "J2 = C|ω3| tan(θ/2)",
            "Δt = (2k + 1) π A cos(θ/2)/(C|ω3|)",
        ),
        "J1, J2 N m s, θ nutation angle, ω3 spin rad/s, k = 0, 1, 2, … With J1 + J2 = A|ω| it costs no more than one "
        "pulse; exact at every angle for ideal impulses.",
        "Where H must stay where it is, with thrusters strong enough for two pulses: few pulses, least impulse.",
        (
            ("--literal", "as printed: two equal halves, wait of small angles, no correction"),
            _TARGET,
        ),
        (
            "Fixed channels may never line up: with A/C - 1 = p/q and 4 | q, four directions ±1, ±2 stay off at small "
            "angles (A/C = 1.25: 45°). The plan then says what it costs or leaves.",
            "A body-fixed pulse moves H by 2M/|ω3| N m s at most, in half a spin turn; targets beyond the reach of two "
            "such pulses are for half-cone, rhumb-line and optimal.",
            "Each half is one pulse: where max_on_time is too short for it, the plan says what remains.",
        ),
        "explain 22, explain 21",
    ),
    _scheme(
        "four-pulse",
        "body-fixed pulses at every alignment, T_ω/4 apart for ±1, ±2",
        (
            "ω turns in the body with the period T_ω. Whenever it points against the torque direction d of a channel, "
            "that channel fires; with four channels ±1, ±2 that is every T_ω/4. Each pulse takes J/A from |ω|, as long "
            "as |ω| is above J/(2A); a last, shorter pulse takes what is left.",
            "The moment is arg ω = arg d + π, which for (A - C)ω3 > 0 is the table of Magnus:",
            Rows(
                (
                    ("+M1", "ω2 = 0 and dω2/dt > 0"),
                    ("-M1", "ω2 = 0 and dω2/dt < 0"),
                    ("+M2", "ω1 = 0 and dω1/dt < 0"),
                    ("-M2", "ω1 = 0 and dω1/dt > 0"),
                )
            ),
            "For (A - C)ω3 < 0 (an oblate body, or a prolate one that spins backwards) it is the mirror image: all "
            "signs of dω/dt change.",
        ),
        ("|ω| after N pulses = |ω0| - N J/A", "rest <= J/(2A), or 0 with the last, shorter pulse"),
        "J N m s effective impulse of a full pulse, A kg m², ω rad/s. N equal pulses turn H by "
        "(J/(C|ω3|)) |sin(Nψ/2)/sin(ψ/2)| with ψ = (π/2) C/(A - C), at small angles.",
        "With body-fixed thrusters too weak for one or two pulses; rate gyros alone tell the moments.",
        (
            ("--on-time TIME", f"{_ON_TIME}; default T_ω/8, or max_on_time if that is shorter"),
            ("--coarse", "full pulses only, no shorter one at the end"),
        ),
        (
            "H turns, by the full θ0 at C = 0.8 A and C = 4A/3, where every pulse pushes it the same way.",
            "Near a sphere T_ω grows as 1/|a|, and so does the time it takes. On a sphere ω does not turn: the two "
            "channels on either side of it share the impulse.",
            "Below the smallest pulse J_min at most J_min/(2A) remains.",
            "It does not go to a target axis.",
        ),
        "explain 12, explain figures",
    ),
    _scheme(
        "optimal",
        "least propellant over channels and firing times, with lower bounds beside it",
        (
            "A linear program over all channels and moments of the horizon finds the cheapest pulses that leave no "
            "nutation and H on its target, at first for small angles. The schedule is flown, the program is taken "
            "anew along that flight, and so on; then centres and on-times are refined on the flight through real "
            "widths.",
        ),
        (
            "minimise Σ c_j J_j,   J_j >= 0, such that",
            "Σ J_j d_j e^(iaω3t_j) = -A ω0     no nutation left",
            "Σ J_j d_j e^(iω3t_j)  = Δh        H on its target",
        ),
        "J_j N m s impulse of pulse j at t_j s, d_j its torque direction in the body as a unit complex number, c_j its "
        "cost, Δh N m s the required shift of H (0: it stays). The first is exact for symmetric bodies, the second "
        "holds for small angles; finite widths multiply them by sinc(aω3τ/2) and sinc(ω3τ/2). Four real equations: "
        "there is an optimum with at most four pulses.",
        "Where propellant, time or the number of pulses counts and thrusters are fixed in the body. `nutdamp trade` "
        "shows what an earlier end costs.",
        (
            ("--least WHAT", "propellant, impulse, time or pulses"),
            ("--free-axis", "H may end anywhere"),
            ("--shift ANGLE", "H may end so far from its target"),
            ("--spin RATE", "spin rate at the end, or keep; needs channels with a torque about axis 3"),
            _TARGET,
        ),
        (
            "Body-fixed channels only.",
            "The plan is a local optimum of the true motion. The bound of first order is that of the program and holds "
            "for small angles; a rigorous one is printed where there is one.",
        ),
        "explain 17, nutdamp trade --help",
    ),
    _scheme(
        "half-cone",
        "swings the spin axis to a target in half nutation turns",
        (
            "A pulse puts H half-way ahead of the spin axis on the great circle to the target; the axis swings round H "
            "for half an inertial nutation turn, then the next pulse puts H ahead again. The last pulse stops the axis "
            "on the target. n half cones take n + 1 pulses.",
            "A nutation at the start is taken along: the first pulse comes when the whole row is cheapest.",
        ),
        ("J = 2n C|ω3| tan(β/2n)",),
        "J N m s total impulse from a pure spin, β angle to the target, n number of half cones. As n grows J falls "
        "towards C|ω3|β, which is the least for turning H by β.",
        "For large turns of the spin axis with strong thrusters or a steerable torquer, in little time.",
        (
            _TARGET,
            ("--cones N", "number of half cones; default the fewest of which one more would save less than 1 %"),
        ),
        (
            "It needs a target axis (--target, or a goal in the file).",
            "A body-fixed pulse moves H by 2M/|ω3| N m s at most; weak thrusters need many cones.",
            "Between the pulses the body nutates by β/2n.",
        ),
        "explain rhumb-line, explain two-pulse, explain nutation",
    ),
    _scheme(
        "rhumb-line",
        "walks the spin axis to a target by short pulses at a fixed inertial phase",
        (
            "Once (or --per-turn times) in each spin turn a short pulse is fired when the channel points the right way "
            "in space: each turns H by the same small angle along a great circle. With --sun the phase is kept against "
            "the Sun, as a Sun sensor gives it, and H follows a rhumb line: a curve of constant heading on the sphere "
            "with the Sun as its pole.",
            "Each pulse also starts a nutation; their number is chosen so that these cancel, and the last pulses are "
            "corrected on the flight.",
        ),
        (
            "turn of H per pulse = J sinc(ω3τ/2)/(C|ω3|)",
            "nutation after N pulses = (J/(C|ω3|)) |sin(Nφ/2)/sin(φ/2)|",
            "φ = 2πC/(A K)",
            "rhumb line: tan χ = Δlongitude/Δln tan(γ/2), length Δγ/cos χ",
        ),
        "J N m s impulse of a pulse, τ s its on-time, ω3 spin rad/s, K pulses a turn, γ angle from the Sun, χ heading, "
        "sinc x = sin x / x. The nutation is that of small angles from a pure spin.",
        "For turning the spin axis with weak thrusters, as spinners do in orbit: least impulse, long time.",
        (
            _TARGET,
            ("--per-turn N", "pulses in each spin turn; default 1"),
            ("--on-time TIME", f"{_ON_TIME}; default an eighth of a spin turn, or max_on_time if that is shorter"),
            ("--sun A,B", "the Sun, given as the target is; default: the great circle to the target"),
        ),
        (
            "It needs a target axis (--target, or a goal in the file).",
            "Where C/(A K) is near a whole number, as near C = A with one pulse a turn, every pulse meets the nutation "
            "in the same phase and it piles up; another number of pulses a turn may help.",
            "Pulses have the length of --on-time within 10 %: all are equal, but the last few, which are corrected. "
            "Where no such train ends on the target, the nearest length that works is named.",
            "With --sun neither the spin axis nor the target may point to the Sun or away from it.",
        ),
        "explain half-cone, explain nutation",
    ),
    Topic(
        "none",
        "free motion, without pulses",
        (
            Part(
                "How it works",
                ("Nothing is fired: the motion is that of the file, with its disturbances where it is flown.",),
            ),
            Part(
                "Equation",
                (Formula(("ω(t) = ω0 e^(-iaω3t)",)), "ω transverse rate rad/s, a = (A - C)/A, ω3 spin rad/s."),
            ),
            Part(
                "When to use it",
                ("With `nutdamp simulate --scheme none`, to see how the body moves by itself, and `nutdamp animate`.",),
            ),
            Part("Options", ("None.",)),
            Part("Limits", ("It plans nothing: `nutdamp plan` does not take it.",)),
            Part("See also", ("explain nutation, explain dissipation",)),
        ),
    ),
)

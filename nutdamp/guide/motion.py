"""The motion itself, energy dissipation, and the figures of Magnus 1970."""

from __future__ import annotations

from nutdamp.guide.topic import Commands, Formula, Part, Rows, Topic

NUTATION = Topic(
    "nutation",
    "angles, cones, rates and periods of the free motion; the frame they refer to",
    (
        Part(
            "Angles",
            (
                "H is the angular momentum, fixed in space without torques. Axis 3 is the symmetry axis; the spin axis "
                "is axis 3 or, with negative spin, its other end. While the spin axis goes round H on a cone, the "
                "rotation vector ω_i = (ω1, ω2, ω3) circles about it in the body:",
                Formula(
                    (
                        "nutation angle  θ = angle(H, spin axis)     tan θ = A|ω|/(C|ω3|)",
                        "body cone       μ = angle(ω_i, spin axis)   tan μ = |ω|/|ω3|",
                        "space cone      λ = angle(ω_i, H)           λ = θ - μ",
                    )
                ),
                "A, C transverse and axial moment of inertia kg m², ω = ω1 + i ω2 and ω3 rad/s.",
                "Prolate bodies (A > C, a = (A - C)/A above 0): λ > 0, the body cone rolls outside on the space cone. "
                "Oblate bodies (A < C, a < 0): λ < 0, the space cone lies inside the body cone. `nutdamp animate` "
                "films it.",
            ),
        ),
        Part(
            "Rates and periods",
            (
                "Seen from the body, from the despun frame and from space the same nutation has three rates:",
                Rows(
                    (
                        ("in the body", "-aω3 rad/s; period T_ω = 2πA/|(A - C)ω3| s (a sphere: ω does not turn)"),
                        ("despun frame", "Cω3/A rad/s: the rate in the body plus ω3"),
                        ("in space", "|H|/A = √(|ω|² + (C/A)²ω3²) rad/s; period 2πA/|H| s"),
                    )
                ),
            ),
        ),
        Part(
            "Three different moments",
            (
                "With I1 ≠ I2 the nutation angle swings between two values while H is fixed. nutdamp then gives "
                "the largest of the arc, and both cones of that instant, so that θ = μ + λ everywhere. Schemes plan on "
                "the symmetric body of the same nutation rate and are corrected on the true one:",
                Formula(("rate in the body = |ω3| √((I1 - C)(I2 - C)/(I1 I2))",)),
            ),
        ),
        Part(
            "Stability",
            (
                "Spin about the axis of largest or least moment keeps a small nutation small, about the middle one it "
                "grows: such a file is refused. About the axis of least moment (prolate) dissipation lets it grow.",
            ),
        ),
        Part(
            "Frame",
            (
                "With attitude in the file, directions are in its frame: right ascension and declination. Without it "
                "in the frame N: z along H at t = 0, and the spin axis at t = 0 in the half plane x >= 0 of x and z; "
                "directions are tilt from z and azimuth about it.",
            ),
        ),
        Part("See also", ("explain 12, 18, 19, 20, K7, K10, K13; explain dissipation",)),
    ),
)

DISSIPATION = Topic(
    "dissipation",
    "energy lost within the body: the nutation of prolate bodies grows, of oblate ones decays",
    (
        Part(
            "",
            (
                "Liquids and flexible parts take energy from the motion, while H stays what it is in length and "
                "direction. dissipation: {time_constant: T} in the file says how fast:",
                Formula(("tan θ = tan θ0 e^(κt),   κ = +1/T for A > C, -1/T for A < C", "dθ/dt = κ sin θ cos θ")),
                "θ nutation angle, t and T s. The law holds at every angle: a prolate body ends in a flat spin, an "
                "oblate one in a pure spin; a sphere has no energy to lose. At small angles it is θ = θ0 e^(κt).",
                "Under dissipation A|ω0| is no least impulse: an oblate body damps by itself, and a prolate one may "
                "cost more.",
            ),
        ),
        Part("See also", ("explain nutation, explain file.dissipation",)),
    ),
)

_FOUR = ("--scheme four-pulse", "--coarse")
_SLENDER = '--set "inertia={A: 100, C: 10}"'
_BLUNT = '--set "inertia={A: 100, C: 70}"'
_OBLATE = '--set "inertia={A: 100, C: 130}"'


def _drawn(name: str, *options: str, command: str = "simulate") -> tuple[str, ...]:
    return (f"nutdamp {command}", *options, "--figure motion", f"--plot {name}.png")


FIGURES = Topic(
    "figures",
    "which commands draw the figures of Magnus 1970, Abb. 2 to 8",
    (
        Part(
            "",
            (
                "--figure motion draws the pole curve, ω in the body, to the left, and the track of the spin axis in "
                "space to the right. The commands change the built-in example, so run them in a folder without a "
                "spacecraft.yaml; they need the extra plot.",
            ),
        ),
        Part(
            "Abb. 5: pole curve of a prolate body, four pulses in the time T_ω (left); Abb. 6: axis track, a = 0.9 "
            "(right)",
            (Commands((_drawn("abb6", _SLENDER, *_FOUR, "--on-time 25ms", command="plan"),)),),
        ),
        Part(
            "Abb. 7: axis track for the same pole curve, a = 0.3",
            (
                Commands((_drawn("abb7", _BLUNT, *_FOUR, "--on-time 175ms", command="plan"),)),
                "Between two pulses the axis turns about H by 210° here and by 10° in Abb. 6: the farther a is from 0, "
                "the faster the damping. An oblate body runs through the mirror image of the pole curve:",
                Commands((_drawn("oblate", _OBLATE, *_FOUR, "--on-time 325ms", command="plan"),)),
            ),
        ),
        Part(
            "Abb. 8: axis track with two pulses, which stop the axis where H was",
            (
                Commands((_drawn("abb8", _BLUNT, '--set "steerable={}"', "--scheme two-pulse"),)),
                "The steerable torquer fires ideal impulses about any transverse axis, as the source assumes.",
            ),
        ),
        Part(
            "Abb. 2: pole cone under a constant torque (left)",
            (
                Commands(
                    (
                        _drawn(
                            "abb2",
                            '--set "disturbances=[{torque: [3 N m, 1 N m, 0]}]"',
                            "--scheme none",
                            "--flown",
                            "--until 6s",
                        ),
                    )
                ),
                "Abb. 1 and 3 are sketches of a sequence of impulses and of the Euler angles.",
            ),
        ),
        Part(
            "Abb. 4: the body cone rolls on the space cone",
            (Commands((("nutdamp animate", "--scheme none", "-o abb4.gif"),)),),
        ),
        Part("See also", ("explain four-pulse, explain two-pulse, explain 11",)),
    ),
)

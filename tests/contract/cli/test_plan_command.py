"""``nutdamp plan`` as a process: what it prints, writes, and leaves with."""

from __future__ import annotations

import csv
import io
import json
import math
from pathlib import Path

import pytest
from support.process import Run

from nutdamp.files.pulses_csv import HEADER

pytestmark = pytest.mark.usefixtures("plans_shared")

WEAK = """
name: Weak
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
thrusters: [{name: T1, torque: [0, 0.5, 0], max_on_time: 100 ms}]
requirement: {nutation: 0.01 deg}
limits: {horizon: 20 s}
"""

NOTHING_FITS = """
name: Late
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 0 deg}
thrusters: [{name: T1, torque: [8, 0, 0]}]
limits: {horizon: 0.1 s}
"""


def test_the_built_in_example_is_planned_in_an_empty_folder(run: Run) -> None:
    done = run("plan")
    assert done.returncode == 0
    assert "built-in example" in done.stderr
    for scheme in ("one-pulse", "two-pulse", "four-pulse"):
        assert scheme in done.stdout
    assert "Recommended: " in done.stdout


def test_a_spacecraft_yaml_in_the_folder_is_found(run: Run, tmp_path: Path) -> None:
    (tmp_path / "spacecraft.yaml").write_text(WEAK.replace("Weak", "Found-Me"))
    done = run("plan", "--scheme", "one-pulse")
    assert "Found-Me" in done.stdout
    assert "reading spacecraft.yaml" in done.stderr


@pytest.mark.parametrize("columns", [80, 140])
def test_no_line_is_cut_or_wider_than_the_screen(run: Run, columns: int) -> None:
    for line in run("plan", columns=columns).stdout.splitlines():
        assert len(line.rstrip()) <= columns
        assert "…" not in line


def test_json_follows_the_contract(run: Run) -> None:
    done = run("plan", "--json", "-")
    data = json.loads(done.stdout)  # nothing but the JSON on standard output
    assert set(data) >= {"nutdamp", "spacecraft", "plans", "recommended"}
    assert set(data["spacecraft"]) >= {
        "name",
        "A_kgm2",
        "C_kgm2",
        "a",
        "shape",
        "omega0_rad_s",
        "nutation_deg",
        "body_cone_deg",
        "space_cone_deg",
        "body_nutation_period_s",
        "inertial_nutation_period_s",
    }
    assert [plan["scheme"] for plan in data["plans"]] == ["one-pulse", "two-pulse", "four-pulse", "optimal"]
    for plan in data["plans"]:
        assert set(plan) >= {
            "scheme",
            "feasible",
            "why",
            "meets_requirement",
            "pulses",
            "total_impulse_Nms",
            "least_impulse_Nms",
            "propellant_kg",
            "end_s",
            "delta_v_m_s",
            "spin_change_rad_s",
            "residual",
            "flown",
        }
        keys = {"nutation_deg", "body_cone_deg", "space_cone_deg", "momentum_shift_deg", "axis_error_deg"}
        assert set(plan["residual"]) == set(plan["flown"]) == keys
        for pulse in plan["pulses"]:
            assert set(pulse) == {
                "t_s",
                "start_s",
                "on_time_s",
                "channel",
                "torque_Nm",
                "impulse_Nms",
                "propellant_kg",
            }
            assert pulse["start_s"] == pytest.approx(pulse["t_s"] - pulse["on_time_s"] / 2, abs=1e-12)
            assert pulse["impulse_Nms"] == pytest.approx([m * pulse["on_time_s"] for m in pulse["torque_Nm"]])


def test_csv_is_the_recommended_plan_and_agrees_with_the_json(run: Run, tmp_path: Path) -> None:
    done = run("plan", "--csv", "pulses.csv", "--json", "plan.json")
    assert done.returncode == 0
    raw = (tmp_path / "pulses.csv").read_bytes().decode()
    assert raw.endswith("\r\n")  # RFC 4180
    rows = list(csv.DictReader(io.StringIO(raw, newline="")))
    assert tuple(rows[0]) == HEADER
    data = json.loads((tmp_path / "plan.json").read_text())
    plan = next(plan for plan in data["plans"] if plan["scheme"] == data["recommended"])
    assert [float(row["t_s"]) for row in rows] == [pulse["t_s"] for pulse in plan["pulses"]]
    assert float(rows[-1]["nutation_after_deg"]) == pytest.approx(plan["flown"]["nutation_deg"], abs=1e-12)
    assert float(rows[0]["nutation_before_deg"]) == pytest.approx(data["spacecraft"]["nutation_deg"], rel=1e-9)


def test_csv_alone_on_standard_output(run: Run) -> None:
    done = run("plan", "--scheme", "two-pulse", "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert [row["pulse"] for row in rows] == ["1", "2"]


def test_schemes_can_be_named(run: Run) -> None:
    data = json.loads(run("plan", "--scheme", "four-pulse", "--scheme", "one-pulse", "--json", "-").stdout)
    assert [plan["scheme"] for plan in data["plans"]] == ["four-pulse", "one-pulse"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("plan", "--scheme", "one-pulse", "--scheme", "two-pulse", "--csv", "x.csv"), "--csv writes one schedule"),
        (("plan", "--csv", "-", "--json", "-"), "cannot both go to standard output"),
        (("plan", "--scheme", "five-pulse"), "four-pulse"),
        (("plan", "--on-time", "20 Hz"), "Hz"),
        (("plan", "--on-time", "0"), "above zero"),
        (("plan", "--no-such-option"), "No such option"),
        (("fly",), "there is no command 'fly'"),
        (("simulatte",), "there is no command 'simulatte'; did you mean 'simulate'?"),
        (("plan", "--scheme", "two-puls"), "did you mean 'two-pulse'?"),
    ],
)
def test_a_bad_command_line_is_exit_2_and_writes_nothing(
    run: Run, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    done = run(*arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_nothing_feasible_is_exit_3_with_json(run: Run, tmp_path: Path) -> None:
    (tmp_path / "late.yaml").write_text(NOTHING_FITS)
    done = run("plan", "late.yaml", "--json", "plan.json", "--csv", "pulses.csv")
    assert done.returncode == 3
    data = json.loads((tmp_path / "plan.json").read_text())
    assert data["recommended"] is None
    for plan in data["plans"]:
        assert plan["feasible"] is False
        assert plan["why"]
        assert plan["pulses"] == []
        assert plan["total_impulse_Nms"] is plan["propellant_kg"] is plan["end_s"] is plan["delta_v_m_s"] is None
        assert set(plan["flown"].values()) == set(plan["residual"].values()) == {None}
    assert "horizon" in done.stdout
    assert not (tmp_path / "pulses.csv").exists()
    assert "pulses.csv was not written" in done.stderr


def test_a_missed_requirement_is_exit_4_with_results(run: Run, tmp_path: Path) -> None:
    (tmp_path / "weak.yaml").write_text(WEAK)
    done = run("plan", "weak.yaml", "--scheme", "two-pulse", "--csv", "pulses.csv")
    assert done.returncode == 4
    assert "Requirement NOT met with nominal values." in done.stdout
    assert (tmp_path / "pulses.csv").exists()


def test_no_nutation_is_an_empty_schedule(run: Run, tmp_path: Path) -> None:
    (tmp_path / "calm.yaml").write_text(WEAK.replace("5 deg", "0 deg"))
    done = run("plan", "calm.yaml", "--json", "-")
    assert done.returncode == 0
    for plan in json.loads(done.stdout)["plans"]:
        assert plan["feasible"] is True
        assert plan["pulses"] == []
        assert plan["flown"]["nutation_deg"] == 0.0
    assert run("plan", "calm.yaml").returncode == 0


def test_what_cannot_be_read_or_written_is_exit_1(run: Run, tmp_path: Path) -> None:
    assert run("plan", "missing.yaml").returncode == 1
    done = run("plan", "--csv", str(tmp_path / "no" / "such" / "folder.csv"))
    assert done.returncode == 1
    assert "cannot write" in done.stderr
    (tmp_path / "folder").mkdir()
    assert run("plan", "--json", "folder").returncode == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder"]


def test_an_old_file_survives_a_failed_run(run: Run, tmp_path: Path) -> None:
    (tmp_path / "late.yaml").write_text(NOTHING_FITS)
    (tmp_path / "pulses.csv").write_text("old")
    run("plan", "late.yaml", "--csv", "pulses.csv")
    assert (tmp_path / "pulses.csv").read_text() == "old"


def test_quiet_says_nothing_on_stderr(run: Run) -> None:
    assert run("plan", "--quiet").stderr == ""


def test_a_reader_that_leaves_is_no_bug(run: Run) -> None:
    import subprocess
    import sys

    done = subprocess.run(
        f"{sys.executable} -m nutdamp simulate --scheme none --samples 50000 --csv - | head -n 1",
        shell=True,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.startswith("t_s,")
    assert "Traceback" not in done.stderr


def test_literal_reproduces_the_printed_scheme(run: Run, tmp_path: Path) -> None:
    ideal = "name: X\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 10 deg}\n"
    (tmp_path / "ideal.yaml").write_text(ideal)
    exact, literal = (
        json.loads(run("plan", "ideal.yaml", "--scheme", "two-pulse", "--json", "-", *flags).stdout)["plans"][0]
        for flags in ((), ("--literal",))
    )
    assert exact["residual"]["momentum_shift_deg"] < 1e-9
    assert literal["residual"]["momentum_shift_deg"] == pytest.approx(0.19, abs=0.005)  # PHYSICS: 0.19° at 10°
    first, second = (math.hypot(*pulse["impulse_Nms"]) for pulse in literal["pulses"])
    assert first == pytest.approx(second, rel=1e-12)


@pytest.mark.deep
def test_a_target_compares_the_schemes_that_can_point(run: Run) -> None:
    """Propellant, time and residual of each against C|ω3|β, in one table that fits the screen."""
    done = run("plan", "--quiet", "--target", "10deg,45deg", "--json", "plans.json", "--scheme", "rhumb-line")
    assert done.returncode == 0, done.stderr
    assert "β = 10 deg from H" in done.stdout
    compared = run("plan", "--quiet", "--target", "2deg,45deg")
    assert all(name in compared.stdout for name in ("two-pulse", "half-cone", "rhumb-line", "optimal", "× C|ω3|β"))
    assert all(len(line) <= 80 for line in compared.stdout.splitlines())


def test_a_scheme_that_cannot_point_says_so(run: Run) -> None:
    done = run("plan", "--quiet", "--target", "10deg,45deg", "--scheme", "one-pulse")
    assert "does not point" in " ".join(done.stdout.split())


def test_cones_and_pulses_per_turn_are_heeded(run: Run, tmp_path: Path) -> None:
    (tmp_path / "body.yaml").write_text("name: b\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 0}\n")
    for option, count, scheme in (("--cones=3", 4, "half-cone"), ("--per-turn=2", None, "rhumb-line")):
        done = run("plan", "body.yaml", "--target", "30deg,0deg", "--scheme", scheme, option, "--json", "-")
        plan = json.loads(done.stdout)["plans"][0]
        assert plan["flown"]["axis_error_deg"] < 1e-7
        if count is not None:
            assert len(plan["pulses"]) == count
        else:
            first, second = (pulse["t_s"] for pulse in plan["pulses"][:2])
            assert second - first == pytest.approx(math.pi / 3.0, rel=1e-3)


def test_the_sun_by_which_the_pulses_keep_their_phase(run: Run, tmp_path: Path) -> None:
    (tmp_path / "body.yaml").write_text("name: b\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 0}\n")
    requested = ("plan", "body.yaml", "--target", "40deg,0deg", "--scheme", "rhumb-line", "--json", "-")
    straight, by_sun = (
        json.loads(run(*requested, *more).stdout)["plans"][0] for more in ((), ("--sun", "40deg,60deg"))
    )
    assert by_sun["total_impulse_Nms"] > 1.01 * straight["total_impulse_Nms"]
    assert run(*requested, "--sun", "190deg,0deg").returncode == 2


# --- awkward spacecraft on the screen ---------------------------------------------------------------------------------

AXIAL = """
name: Axial
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
thrusters: [{name: T1, torque: [0, 0, 5]}]
"""

AT_REST = """
name: At rest
inertia: {A: 100, C: 200}
state: {spin: 30 rpm, nutation: 0 deg}
"""

SPHERE = """
name: Sphere
inertia: {A: 100, C: 100}
state: {spin: 30 rpm, nutation: 5 deg}
"""


def test_what_holds_for_all_schemes_is_said_once_and_no_empty_rows_are_shown(run: Run, tmp_path: Path) -> None:
    (tmp_path / "axial.yaml").write_text(AXIAL)
    done = run("plan", "axial.yaml", columns=140)
    assert done.returncode == 3
    assert done.stdout.count("no channel has a torque more transverse than axial") == 1
    assert "one-pulse, two-pulse, four-pulse, optimal: no channel" in done.stdout
    assert "nutation left" not in done.stdout


def test_without_nutation_the_screen_says_so(run: Run, tmp_path: Path) -> None:
    (tmp_path / "rest.yaml").write_text(AT_REST)
    done = run("plan", "rest.yaml")
    assert done.returncode == 0
    assert done.stdout.count("there is no nutation to damp") == 1


def test_the_nutation_of_a_sphere_has_no_period_in_the_body(run: Run, tmp_path: Path) -> None:
    (tmp_path / "sphere.yaml").write_text(SPHERE)
    assert "none in the body, where ω does not turn, 1.992 s inertially" in run("plan", "sphere.yaml").stdout


def test_a_target_without_unit_is_read_as_rad_and_says_so(run: Run) -> None:
    done = run("plan", "--quiet", "--target", "10,45")
    assert done.returncode == 2
    assert "10 is read as 10 rad (573 deg); write 10 deg if that is meant, else 10 rad" in " ".join(done.stderr.split())
    taken = run("plan", "--target", "1,45.5", "--scheme", "two-pulse")
    assert "--target: warning: 1 is read as 1 rad (57.3 deg); write 1 deg" in taken.stderr
    assert "--target: warning: 45.5 is read as 45.5 rad (2607 deg)" in taken.stderr
    for angles in ("0,0", "0.2,1.5", "10deg,45 °", "2 rad,0"):
        assert "is read as" not in run("plan", "--target", angles, "--scheme", "two-pulse").stderr


def test_each_part_of_the_requirement_is_shown_beside_what_is_left(run: Run) -> None:
    done = run("plan", "--quiet", "--json", "plans.json", columns=80)
    assert "requirement      nutation within 0.5 deg and shift of H within 0.2 deg\n" in done.stdout
    rows = {line[:22].strip(): line[22:].split("  ") for line in done.stdout.splitlines()}
    cells = [cell.strip() for cell in rows["shift of H ≤ 0.2 deg"] if cell.strip()]
    assert cells == ["✗ 3.462", "< 1e-9", "0.1684", "< 1e-9"]
    aimed = run("plan", "--quiet", "--target", "2deg,0deg", "--scheme", "optimal").stdout
    assert "  error of H ≤ 0.2 deg" in aimed
    said = "momentum_shift bounds the error of H: its angle from the target"
    assert said in aimed
    assert said not in done.stdout


def test_a_requirement_below_rounding_is_shown_as_it_was_given(run: Run) -> None:
    """It read "shift of H within < 1e-9 deg"."""
    done = run("plan", "--set", "requirement.momentum_shift=1e-12 deg")
    assert "nutation within 0.5 deg and shift of H within 1e-12 deg\n" in done.stdout
    assert "  shift of H ≤ 1e-12 deg " in done.stdout


def test_json_holds_each_part_of_the_requirement(run: Run) -> None:
    compared = json.loads(run("plan", "--quiet", "--json", "-").stdout)
    assert compared["no_pulse_needed"] is False
    one, two = compared["plans"][0]["requirement"]
    assert (one["part"], one["met"], one["most_deg"]) == ("nutation", True, pytest.approx(0.5))
    assert (two["part"], two["met"], two["most_deg"]) == ("momentum_shift", False, pytest.approx(0.2))
    assert two["left_deg"] == pytest.approx(compared["plans"][0]["flown"]["momentum_shift_deg"])
    spun = json.loads(run("plan", "--quiet", "--spin", "keep", "--scheme", "four-pulse", "--json", "-").stdout)
    assert spun["plans"][0]["requirement"][2]["part"] == "spin"
    easy = run("plan", "--set", "state.nutation=0.3deg", "--set", "requirement.nutation=1deg", columns=80)
    assert easy.stdout.splitlines()[1].startswith("No pulse needed: the nutation of 0.3 deg at t = 0 already meets")


@pytest.mark.deep
def test_a_target_along_h_is_compared_with_no_rounding(run: Run) -> None:
    done = run("plan", "--target", "0deg,0deg", columns=80)
    (row,) = [line for line in done.stdout.splitlines() if "× C|ω3|β" in line]
    assert set(row.split()[2:]) == {"–"}
    assert "C|ω3|β = 0 N m s" in done.stdout
    assert "…" not in done.stdout

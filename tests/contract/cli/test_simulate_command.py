"""``nutdamp simulate``: schemes, schedules and free motion, their track, and the exit status."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support import places
from support.commands import EXACT, SCHEDULE, result, rows, written
from support.golden import check_text
from support.process import Run

from nutdamp.files.tabular import HEADER

pytestmark = pytest.mark.usefixtures("plans_shared")

ATTITUDE = "attitude={epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}"


def test_the_screen_of_a_scheme(run: Run) -> None:
    """With right ascension and declination where the file has an attitude."""
    plain, full = (run("simulate", "--scheme", "two-pulse", *more) for more in ((), ("-v",)))
    dated = run("simulate", "--scheme", "two-pulse", "-v", "--set", ATTITUDE)
    assert plain.returncode == full.returncode == dated.returncode == 0
    check_text("cli.simulate.screen", plain.stdout)
    check_text("cli.simulate.full", full.stdout)
    assert "right ascension" in dated.stdout
    assert "EME2000" in dated.stdout


def test_the_track_has_the_columns_of_the_contract(run: Run, tmp_path: Path) -> None:
    assert run("simulate", "--scheme", "four-pulse", "--csv", "track.csv", "--samples", "50").returncode == 4
    track = rows((tmp_path / "track.csv").read_text())
    assert tuple(track[0]) == HEADER
    times = [float(row["t_s"]) for row in track]
    assert times == sorted(times)
    assert (track[0]["pulse"], track[-1]["pulse"]) == ("0", "4")
    for row in track:
        assert sum(float(row[f"q_{part}"]) ** 2 for part in "wxyz") == pytest.approx(1.0, abs=1e-14)
        cones = float(row["body_cone_deg"]) + float(row["space_cone_deg"])
        assert float(row["nutation_deg"]) == pytest.approx(cones, abs=1e-12)


def test_a_written_schedule_flies_as_it_was_planned(run: Run) -> None:
    """From a file, by its flown columns, or from standard input."""
    planned = result(run, "plan --scheme two-pulse --csv pulses.csv")["plans"][0]
    for flown in ("", "--flown"):
        flight = result(run, f"simulate --schedule pulses.csv {flown}")
        for kind in ("residual", "flown"):
            assert flight[kind] == pytest.approx(planned[kind], abs=1e-11)
    pulses = run("plan", "--scheme", "two-pulse", "--csv", "-", "-q").stdout
    assert result(run, "simulate --schedule -", stdin=pulses)["flown"] == flight["flown"]


@pytest.mark.parametrize(
    ("keys", "scheme", "status", "grows"),
    [
        ("upper-stage.yaml --set limits.tick=20ms", "one-pulse", 0, True),
        ("communications-spinner.yaml --set limits.max_pulses=3", "four-pulse", 4, False),
    ],
)
def test_a_written_schedule_is_judged_as_the_plan_wherever_the_simulation_ends(
    run: Run, keys: str, scheme: str, status: int, grows: bool
) -> None:
    """The motion after the last pulse changes; what is said of its end is marked as that."""
    file = f"{places.CONFIGS}/{keys}"
    planned = result(run, f"plan {file} --nominal --scheme {scheme} --csv own.csv", status=status)
    for until in ("", "--until 300s"):
        flight = result(run, f"simulate {file} --schedule own.csv {until}", status=status)
        assert flight["judged_s"] == pytest.approx(planned["plans"][0]["end_s"], abs=1e-9)
        ways = zip(planned["decision"]["requirement"], flight["decision"]["requirement"], strict=True)
        for before, after in ways:
            assert after["nominal_deg"] == pytest.approx(before["nominal_deg"], abs=1e-9)
            assert after["part"] == before["part"]
    screen = run("simulate", *file.split(), "--schedule", "own.csv", "--until", "300s").stdout
    assert ("note[judged-at-end]" in screen) is grows


def test_schedules_by_hand_may_be_short_and_settings_are_doubted(run: Run, tmp_path: Path) -> None:
    written(tmp_path, own_csv=SCHEDULE.replace(",channel", "").replace("1,0,steerable,4", "1,0,-5") + "2,0.5,0,4,0\n")
    first, second = result(run, "simulate --schedule own.csv", status=4)["pulses"]
    assert first["torque_Nm"] is None
    assert second["torque_Nm"] == pytest.approx([0, 8, 0])
    run("plan", "--scheme", "one-pulse", "--csv", "pulses.csv")
    edited = run("simulate", "--schedule", "pulses.csv", "--set", "state.nutation=0.2", "--quiet")
    assert edited.returncode == 4
    check_text("cli.simulate.doubts", edited.stderr)  # which --quiet leaves


def test_without_a_scheme_the_recommended_plan_is_propagated_and_named(run: Run) -> None:
    ended = run("simulate")
    assert ended.returncode == 0
    assert "using recommended plan: two-pulse\n" in ended.stderr
    assert ended.stdout == run("simulate", "--scheme", "two-pulse").stdout


def test_free_motion_keeps_its_nutation_and_the_end_can_be_chosen(run: Run) -> None:
    free = result(run, "simulate --scheme none", status=4)
    assert free["pulses"] == []
    assert free["flown"]["nutation_deg"] == pytest.approx(free["spacecraft"]["nutation_deg"], rel=1e-12)
    early = result(run, "simulate --scheme two-pulse --until '3 s'")
    assert early["until_s"] == 3.0
    assert early["flown"]["nutation_deg"] > 1.0  # the second pulse is still to come


def test_the_exit_status_is_that_of_plan(run: Run, tmp_path: Path) -> None:
    """3 where the scheme is infeasible, 4 where it is not shown that its plan meets the requirement; so for none."""
    written(tmp_path, ideal_yaml=EXACT)
    infeasible = run("simulate", "ideal.yaml", "--scheme", "four-pulse")
    assert (infeasible.returncode, "infeasible" in infeasible.stderr) == (3, True)
    tight = ("--set", "requirement.momentum_shift=1e-4 deg")
    for scheme, settings, status in (("one-pulse", (), 4), ("two-pulse", (), 0), ("two-pulse", tight, 4)):
        assert run("plan", "--scheme", scheme, *settings).returncode == status
        ended = run("simulate", "--scheme", scheme, *settings)
        assert (ended.returncode, "\nNOT ENOUGH: " in ended.stdout) == (status, status == 4)
    assert run("simulate", "--scheme", "none", *tight).returncode == 4
    early = run("simulate", "--scheme", "two-pulse", "--until", "1 ms")
    assert (early.returncode, "0 to 0.001 s" in early.stdout) == (0, True)


KEEPER = """
name: Keeper
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
steerable: {torque: 60 N m}
requirement: {nutation: 1 deg}
attitude: {frame: EME2000, quaternion: [1, 0, 0, 0]}
keep: [{name: star, direction: [0, 89 deg], min: 5 deg}]
"""


def test_a_broken_cone_is_exit_4_and_said_once(run: Run, tmp_path: Path) -> None:
    """By the verdict on the screen; as a remark where the results take the place of the screen."""
    command = ("simulate", "-", "--scheme", "two-pulse")
    assert run(*command, "--set", "keep=[]", stdin=KEEPER).returncode == 0
    assert run(*command, "--json", "end.json", stdin=KEEPER).returncode == 4
    assert json.loads((tmp_path / "end.json").read_text())["decision"]["met"] is False
    for named in (command, command[:2]):
        for outputs in ((), ("--json", "-")):
            ended = run(*named, *outputs, stdin=KEEPER)
            said = " ".join((ended.stderr + ended.stdout * (not outputs)).split())
            assert said.lower().count("the spin axis comes to") == 1


def test_with_a_target_the_screen_says_how_far_off_it_ends(run: Run) -> None:
    done = run("simulate", "--scheme", "none", "--target", "10deg,45deg", "--samples", "2")
    assert "axis error" in done.stdout

"""``nutdamp simulate`` as a process."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from support.cases import spread
from support.process import Run

from nutdamp.files.track_csv import HEADER

pytestmark = pytest.mark.usefixtures("plans_shared")


def test_a_scheme_is_simulated_in_an_empty_folder(run: Run) -> None:
    done = run("simulate", "--scheme", "two-pulse")
    assert done.returncode == 0
    for text in ("before", "after", "by impulses (17)", "flown, real widths", "spin axis from H(0)"):
        assert text in done.stdout


def test_the_track_has_the_columns_of_the_contract(run: Run, tmp_path: Path) -> None:
    assert run("simulate", "--scheme", "four-pulse", "--csv", "track.csv", "--samples", "50").returncode == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "track.csv").read_text())))
    assert tuple(rows[0]) == HEADER
    times = [float(row["t_s"]) for row in rows]
    assert times == sorted(times)
    assert rows[0]["pulse"] == "0"
    assert int(rows[-1]["pulse"]) == 4
    for row in rows:
        length = sum(float(row[f"q_{part}"]) ** 2 for part in "wxyz")
        assert length == pytest.approx(1.0, abs=1e-14)
        assert float(row["nutation_deg"]) == pytest.approx(
            float(row["body_cone_deg"]) + float(row["space_cone_deg"]), abs=1e-12
        )


@pytest.mark.parametrize("flown", [(), ("--flown",)])
def test_a_written_schedule_flies_as_it_was_planned(run: Run, flown: tuple[str, ...]) -> None:
    planned = json.loads(run("plan", "--scheme", "two-pulse", "--csv", "pulses.csv", "--json", "-").stdout)
    flight = json.loads(run("simulate", "--schedule", "pulses.csv", "--json", "-", *flown).stdout)
    for kind in ("residual", "flown"):
        assert flight[kind] == pytest.approx(planned["plans"][0][kind], abs=1e-11)


def test_an_edited_schedule_warns_of_columns_that_contradict(run: Run, tmp_path: Path) -> None:
    run("plan", "--scheme", "one-pulse", "--csv", "pulses.csv")
    path = tmp_path / "pulses.csv"
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    rows[0]["t_s"] = str(float(rows[0]["t_s"]) + 0.25)
    with path.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    done = run("simulate", "--schedule", "pulses.csv")
    assert done.returncode == 4  # one pulse shifts H by more than the requirement allows
    assert "pulses.csv:2: t_s" in done.stderr
    assert "start_s + on_time_s/2" in done.stderr
    assert done.stderr.count("ignored") == 1


def test_the_shortest_schedule_has_three_kinds_of_columns(run: Run, tmp_path: Path) -> None:
    header = "t_s,on_time_s,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms"
    (tmp_path / "own.csv").write_text(f"{header}\n1.0,0,-5,0,0\n2.0,0.5,0,4,0\n")
    data = json.loads(run("simulate", "--schedule", "own.csv", "--json", "-").stdout)
    assert len(data["pulses"]) == 2
    assert data["pulses"][0]["torque_Nm"] is None
    assert data["pulses"][1]["torque_Nm"] == pytest.approx([0, 8, 0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("t_s,on_time_s\n1,2\n", "channel: the column is missing"),
        ("t_s,on_time_s,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,0,a,0,0\n", ":2:1: impulse_1_Nms: 'a' is not a"),
        ("t_s,on_time_s,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,-1,1,0,0\n", "negative"),
        ("t_s,on_time_s,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,4,1,0,0\n", "0 s or later is expected"),
        ("t_s,on_time_s,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\nnan,0,1,0,0\n", "out of range"),
        ("t_s,on_time_s,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,0,1\n", "3 values under 5 columns"),
        ("t_s,t_s,on_time_s,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,1,0,1,0,0\n", "twice"),
        (
            "t_s,on_time_s,channel,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,1,+M1,8,0,0\n1.5,1,+M1,8,0,0\n",
            "still firing the pulse of line 2",
        ),
    ],
    ids=["empty", "columns", "word", "negative", "early", "nan", "short", "double", "overlap"],
)
def test_a_broken_schedule_is_exit_2_with_its_place(run: Run, tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "broken.csv").write_text(text)
    done = run("simulate", "--schedule", "broken.csv", "--csv", "track.csv")
    assert done.returncode == 2
    assert "broken.csv:" in done.stderr
    assert said in done.stderr
    assert not (tmp_path / "track.csv").exists()


def test_binary_and_missing_schedules(run: Run, tmp_path: Path) -> None:
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    assert run("simulate", "--schedule", "binary.csv").returncode == 2
    assert run("simulate", "--schedule", "missing.csv").returncode == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ("--scheme", "one-pulse", "--schedule", "x.csv"),
        ("--scheme", "one-pulse", "--until", "-1"),
        ("--scheme", "one-pulse", "--until", "1 m"),
        ("--scheme", "one-pulse", "--samples", "1"),
        ("--scheme", "one-pulse", "--plot", "picture.bmp"),
    ],
)
def test_bad_command_lines_are_exit_2(run: Run, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    done = run("simulate", *arguments)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_without_a_scheme_the_recommended_plan_is_propagated_and_named(run: Run) -> None:
    """As `disperse`, `verify` and `report` do; it was refused."""
    done = run("simulate")
    assert done.returncode == 0
    assert "no --scheme and no --schedule named: using the recommended plan, optimal\n" in done.stderr
    assert done.stdout == run("simulate", "--scheme", "optimal").stdout


def test_free_motion_keeps_its_nutation(run: Run) -> None:
    data = json.loads(run("simulate", "--scheme", "none", "--json", "-").stdout)
    assert data["pulses"] == []
    assert data["flown"]["nutation_deg"] == pytest.approx(data["spacecraft"]["nutation_deg"], rel=1e-12)


def test_an_infeasible_scheme_is_exit_3(run: Run, tmp_path: Path) -> None:
    (tmp_path / "ideal.yaml").write_text("name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n")
    done = run("simulate", "ideal.yaml", "--scheme", "four-pulse")
    assert done.returncode == 3
    assert "infeasible" in done.stderr


def test_the_end_can_be_chosen(run: Run) -> None:
    data = json.loads(run("simulate", "--scheme", "two-pulse", "--until", "3 s", "--json", "-").stdout)
    assert data["until_s"] == 3.0
    assert data["flown"]["nutation_deg"] > 1.0  # the second pulse is still to come


@pytest.mark.deep
@spread(("ending", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")], quick=1)
def test_pictures_are_drawn_in_three_formats(run: Run, tmp_path: Path, ending: str, magic: bytes) -> None:
    assert run("simulate", "--scheme", "four-pulse", "--plot", f"motion.{ending}").returncode == 0
    assert (tmp_path / f"motion.{ending}").read_bytes().startswith(magic)


def test_right_ascension_and_declination_with_an_attitude(run: Run, tmp_path: Path) -> None:
    run("init")
    text = (tmp_path / "spacecraft.yaml").read_text()
    attitude = "attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}\n"
    (tmp_path / "spacecraft.yaml").write_text(text + attitude)
    done = run("simulate", "--scheme", "two-pulse")
    assert "right ascension" in done.stdout
    assert "EME2000" in done.stdout


def test_the_exit_status_is_that_of_plan(run: Run) -> None:
    """4 where the flown motion does not meet the requirement or keep a cone; so for free motion."""
    tight = ("--set", "requirement.momentum_shift=1e-4 deg")
    for scheme in ("one-pulse", "four-pulse"):
        for settings in ((), tight):
            planned = run("plan", "--scheme", scheme, *settings).returncode
            done = run("simulate", "--scheme", scheme, *settings)
            assert done.returncode == planned
            assert ("Requirement NOT met" in done.stdout) == (planned == 4)
    assert run("simulate", "--scheme", "four-pulse", *tight).returncode == 4
    assert run("simulate", "--scheme", "none", *tight).returncode == 4
    early = run("simulate", "--scheme", "four-pulse", *tight, "--until", "1 ms")
    assert early.returncode == 0
    assert "0 to 0.001 s" in early.stdout


def test_a_cone_that_is_broken_is_as_bad(run: Run, tmp_path: Path) -> None:
    text = (
        "name: Keeper\ninertia: {A: 120, C: 80}\nstate: {spin: 30 rpm, nutation: 5 deg}\n"
        "steerable: {torque: 60 N m}\nrequirement: {nutation: 1 deg}\n"
        "attitude: {frame: EME2000, quaternion: [1, 0, 0, 0]}\n"
        "keep: [{name: star, direction: [0, 89 deg], min: 1 deg}]\n"
    )
    kept = run("simulate", "-", "--scheme", "two-pulse", "--set", "keep=[]", stdin=text)
    broken = run(
        "simulate", "-", "--scheme", "two-pulse", "--json", "end.json", "--set", "keep.star.min=5 deg", stdin=text
    )
    assert (kept.returncode, broken.returncode) == (0, 4)
    assert json.loads((tmp_path / "end.json").read_text())["decision"]["met"] is False


def test_a_broken_cone_is_said_once(run: Run) -> None:
    """By the verdict on the screen; as a remark where the results take the place of the screen."""
    text = (
        "name: Keeper\ninertia: {A: 120, C: 80}\nstate: {spin: 30 rpm, nutation: 5 deg}\n"
        "steerable: {torque: 60 N m}\nrequirement: {nutation: 1 deg}\n"
        "attitude: {frame: EME2000, quaternion: [1, 0, 0, 0]}\n"
        "keep: [{name: star, direction: [0, 89 deg], min: 5 deg}]\n"
    )
    for named in (("--scheme", "two-pulse"), ()):
        for outputs in ((), ("--json", "-")):
            done = run("simulate", "-", *named, *outputs, stdin=text)
            said = done.stderr + done.stdout * (not outputs)
            assert " ".join(said.split()).count("the spin axis comes to") + said.count("The spin axis comes to") == 1

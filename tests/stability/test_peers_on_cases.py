"""Other programs on the hard cases: what is handed on to them, how they are judged, and that one which hangs or dies does not matter."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rods import GRAVITY, cable, grasps
from scipy.spatial.transform import Rotation
from test_hard_cases import hardcases

from protocol.errors import CablecosimError
from protocol.hard_case import Case, Check, Ending, Verdict
from protocol.messages import Problem
from scenarios import beside, hard_cases
from shape_server import kernels
from shape_server.accuracy.peers import peer_mujoco, peer_scipy
from shape_server.hard_cases import peers
from shape_server.hard_cases.answers import found
from shape_server.hard_cases.catalogue import catalogue
from shape_server.hard_cases.posing import frame

CASES = {case.name: case for case in peers.cases_of(catalogue())}


def on_scipy(case: Case) -> Verdict:
    return case.run((peer_scipy, kernels))


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("EI 0.01, clamps level", 0.06),
        ("GJ/EI 3, one end turned by 2 rad", 0.05),
        ("length 1000 m has the shape of 1 m, askew", 0.05),
        ("gravity along the cable, EI 0.001", 0.02),
        ("gravity upwards, EI 0.01", 0.1),
    ],
)
def test_scipy_is_right_where_it_can_be(name: str, share: float) -> None:
    """Wherever gravity points, however long the cable: what is handed on is the same problem. `share` of a hundredth of the length."""
    verdict = on_scipy(CASES[name])
    assert verdict.ending is Ending.RIGHT, verdict.sentence
    assert verdict.error < 1.5 * share  # measured 1.0 of it and less


def test_a_cable_whose_far_end_is_the_lower_one_is_handed_on_from_its_other_end() -> None:
    held = grasps((0.0, (0.0, 0.0, 0.3), frame((1.0, 0.2, 0.0))), (1.0, (0.4, 0.1, 0.0), frame((1.0, 0.0, 0.5))))
    problem = Problem(cable=cable(), grasps=held)
    units = peers.Units.of(problem, GRAVITY)
    assert units.is_reversed
    assert units.posed.position[1, 2] == pytest.approx(0.3)
    tangents = Rotation.from_quat(units.posed.quaternion).apply([0.0, 0.0, 1.0])
    assert tangents[0] @ tangents[1] == pytest.approx(1.0 / np.sqrt(1.04 * 1.25))
    case = Case("falling", "x", lambda path: [Check("none", 0.0, 1.0)] if found(problem, GRAVITY, path) else [])
    verdict = on_scipy(peers.cases_of([case])[0])
    assert verdict.ending is Ending.RIGHT, verdict.sentence


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("squeezed between two faces with 0 m to spare", "no branch"),
        ("random, forces of 0 N", "no branch"),
        ("nearer: a hundred steps against one jump", "no branch"),
        ("no gravity, EI 0.01", "without weight"),
        ("held at 10 points, clamps", "two ends"),
        ("a micrometre short of the full length, hinges", "clamps"),
        ("EA 1e+06, chord 0.6, catenary", "inextensible"),
    ],
)
def test_what_a_peer_is_not_set_up_for_is_told_and_not_handed_on(name: str, words: str) -> None:
    verdict = on_scipy(CASES[name])
    assert verdict.ending is Ending.OUTSIDE
    assert words in verdict.sentence


def test_a_peer_must_not_stretch_a_cable_to_where_it_does_not_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    case = CASES["chord 1.01 of 1 m, clamp, with bending"]
    assert on_scipy(case).ending is Ending.REFUSED
    s = np.linspace(0.0, 1.0, 11)
    monkeypatch.setattr(peers.posed, "nodes", lambda peer, posed: (s, np.outer(1.01 * s, (1.0, 0.0, 0.0))))
    verdict = on_scipy(case)
    assert verdict.ending is Ending.WRONG
    assert "stretched" in verdict.sentence
    assert verdict.error == pytest.approx(10.0)


def test_a_peer_that_is_off_or_ends_in_no_numbers_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    case, s = CASES["EI 0.01, clamps level"], np.linspace(0.0, 1.0, 11)
    monkeypatch.setattr(peers.posed, "nodes", lambda peer, posed: (s, np.outer(s, (0.7, 0.0, 0.0))))
    assert on_scipy(case).ending is Ending.WRONG
    monkeypatch.setattr(peers.posed, "nodes", lambda peer, posed: (s, np.full((11, 3), np.nan)))
    assert on_scipy(case).ending is Ending.REFUSED  # it is how SciPy says that it finds none
    monkeypatch.setattr(peers.posed, "nodes", lambda peer, posed: 1 / 0)
    assert on_scipy(case).ending is Ending.REFUSED
    monkeypatch.setattr(peers.posed, "nodes", lambda peer, posed: (s, np.full((11, 3), np.nan)))
    assert case.run((peer_mujoco, kernels)).sentence == "MuJoCo 4 flex rod: not a number"


@pytest.mark.slow
def test_a_peer_that_hangs_is_ended_and_shown_beside_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = [case for case in hard_cases.listed("stiffness") if case.name in ("EI 0.01, clamps level", "EI 0.1, clamps level")]
    monkeypatch.setattr(hard_cases, "PATIENCE", 1e-3)
    theirs = list(hard_cases.ask("scipy", listed, "compiled"))
    ours = [hard_cases.Result(case, Verdict(Ending.RIGHT, 0.5, "ours"), 0.1) for case in listed]
    assert "no answer in" in beside.table(ours, {"scipy": theirs})


def results(*verdicts: Verdict) -> Iterator[hard_cases.Result]:
    for number, verdict in enumerate(verdicts):
        case = hard_cases.Listed("shape_server", number, "family", f"case {number}", is_slow=False, known="")
        yield hard_cases.Result(case, verdict, 0.1)


def test_the_table_has_the_outcomes_of_all_beside_each_other() -> None:
    ours = list(results(*[Verdict(Ending.RIGHT, 0.5, "right")] * 5))
    theirs = list(
        results(
            Verdict(Ending.RIGHT, 0.03, "right"),
            Verdict(Ending.WRONG, 12.0, "far"),
            Verdict(Ending.WRONG, np.inf, "Somebody: not a number"),
            Verdict(Ending.WRONG, np.inf, "the process died with exit code -11"),
            Verdict(Ending.OUTSIDE, 0.0, "contacts"),
        )
    )
    lines = beside.table(ours, {"somebody": theirs}).splitlines()
    assert lines[3].split() == ["family", "4/0/0", "1/0/3"]
    rows = {line.split("  ")[0]: line for line in lines[7:]}
    assert rows["family: case 0"].endswith("right 0.03")
    assert rows["family: case 1"].endswith("off 12")
    assert rows["family: case 2"].endswith("not a number")
    assert rows["family: case 3"].endswith("died with exit code -11")
    assert "family: case 4" not in rows


@pytest.mark.thorough
def test_a_peer_that_is_not_there_is_refused_with_those_that_are() -> None:
    assert "scipy" in hard_cases.peers()
    with pytest.raises(CablecosimError, match="peer 'ansys' is not installed; there are 'scipy'"):
        hard_cases.peers(["ansys"])


def test_all_peers_say_which_setting_is_careful() -> None:
    rod = SimpleNamespace(bending=1e-2, twist=1e-2, length=1.0, weight=1.0)
    assert all(str(peer.careful(rod)) for name, peer in peers.PEERS.items() if name != "moorpy")


@pytest.mark.slow
def test_the_command_asks_a_peer_and_writes_what_it_makes_of_every_case(tmp_path: Path) -> None:
    run = hardcases("--family", "floors", "--peers", "scipy", "--json", "cases.json", folder=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    written = json.loads((tmp_path / "cases.json").read_text(encoding="utf-8"))
    assert {row["peers"]["scipy"]["ending"] for row in written} == {"outside"}

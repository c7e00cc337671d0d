"""Rods whose clamps move: what tolerance, mesh and time step cost, and which other programs are here to compare with."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from shape_server.accuracy import moving
from shape_server.accuracy.frontier import sentence
from shape_server.accuracy.peers import installed, ours, peer_cabledyn, peer_moorpy, peer_mujoco, peer_pyelastica, peer_scipy
from shape_server.accuracy.study import AUTOMATIC, Studied

ABSENT = SimpleNamespace(NAME="Nobody's rods", DISTRIBUTION="no-such-distribution", VERSION=(1, 0), INSTALL="There is none.")
PLANE = moving.standard()[0]


@pytest.fixture(scope="module")
def studied() -> Studied:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(moving, "TOLERANCES", (1e-3, 1e-5))
        patch.setattr(moving, "STRIDES", (1, 20))
        patch.setattr(ours, "sweep", lambda motions: (ours.Setting(20, extrapolate=False), ours.Setting(40, extrapolate=True)))
        patch.setattr(installed, "FOLLOWING", (ABSENT,))
        return moving.study(PLANE)


@pytest.mark.thorough
def test_every_posture_of_the_loop_is_within_the_tolerance(studied: Studied) -> None:
    automatic = [row for row in studied.rows if row.group == AUTOMATIC]
    assert [row.setting for row in automatic] == ["0.001 L", "1e-05 L"]
    for row, tolerance in zip(automatic, (1e-3, 1e-5), strict=True):
        assert row.error <= row.estimate  # measured 0.80 and 0.76 of it
        assert row.error <= tolerance


def test_longer_time_steps_cost_less_and_statics_forget_them(studied: Studied) -> None:
    short, long = (row for row in studied.rows if row.group == moving.TIME_STEP)
    assert long.error == pytest.approx(short.error, rel=0.01)
    assert long.factorisations < short.factorisations / 3  # measured 0.09: a long motion takes more steps, but not ten times as many


def test_a_follower_is_as_exact_as_its_mesh(studied: Studied) -> None:
    coarse, fine = (row.error for row in studied.rows if row.group == moving.FOLLOWER)
    assert coarse < 5e-3  # measured 4.2e-3
    assert fine < 1e-5  # measured 8.2e-6


def test_a_program_that_is_not_installed_is_said(studied: Studied) -> None:
    assert studied.peers == ()
    assert "Nobody's rods is not installed and left out. There is none." in sentence(studied)


def test_every_peer_says_what_it_is_and_how_it_is_installed() -> None:
    for peer in (peer_scipy, peer_mujoco, peer_cabledyn, peer_pyelastica, peer_moorpy):
        assert peer.NAME in installed.missing(peer)
        assert peer.INSTALL in installed.missing(peer)
    assert installed.is_installed(peer_scipy)

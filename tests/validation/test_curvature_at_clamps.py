"""Curvature at clamps, against an initial-value problem of Kirchhoff's rod that scipy integrates from a force and a moment chosen there.

Without weight the force n stays, and with the frame R, the moment m in its axes and K = diag(EI_1, EI_2, GJ):

    r' = R e_3,   R' = R [K^-1 m]x,   m' = -(K^-1 m) x m - e_3 x R^T n

The frames that come out at both ends are the clamps of the problem, and the curvature there is that of the moment, m / K. In a cell
beside a clamp the axes of the section have turned on already, so that a cell's own curvature would be right to first order only where
the section is not round, or the rod twisted.
"""

from __future__ import annotations

import numpy as np
import pytest
from posed import grasps
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shape_server.kernels as compiled
from protocol.kinds import Hold, Outcome
from protocol.messages import Problem, Shape, Start
from protocol.scene import Cable
from shape_server import solve

LAWS = np.array([1e-3, 2.5e-3, 0.8e-3])  # N m^2
FORCE = np.array([2e-3, -1e-3, 4e-3])  # N, of what follows
MOMENT = np.array([1.5e-3, -2.5e-3, 1.2e-3])  # N m, at the start, in the axes of the section
CABLE = Cable("cable", 1.0, 1e-3, 0.1, LAWS[0], LAWS[2], LAWS[1])


def along(_: float, state: np.ndarray) -> np.ndarray:
    frame, moment = Rotation.from_quat(state[3:7]), state[7:]
    bent = moment / LAWS
    x, y, z, w = state[3:7]
    u, v, t = 0.5 * bent
    turn = [w * u + y * t - z * v, w * v + z * u - x * t, w * t + x * v - y * u, -(x * u + y * v + z * t)]
    slope = -np.cross(bent, moment) - np.cross([0.0, 0.0, 1.0], frame.inv().apply(FORCE))
    return np.concatenate([frame.apply([0.0, 0.0, 1.0]), turn, slope])


INTEGRATED = solve_ivp(along, (0.0, 1.0), np.concatenate([np.zeros(3), [0, 0, 0, 1], MOMENT]), rtol=1e-11, atol=1e-13, dense_output=True)


def shape(segments: int) -> Shape:
    """On a mesh of its own, started from the integrated frames."""
    s = np.linspace(0.0, 1.0, segments + 1)
    frames = INTEGRATED.sol(0.5 * (s[1:] + s[:-1]))[3:7].T
    start = Start(s=s, frames=frames / np.linalg.norm(frames, axis=1)[:, None], grasp_forces=np.array([-FORCE, FORCE]))
    held = [(at, INTEGRATED.sol(at)[:3], INTEGRATED.sol(at)[3:7], Hold.CLAMP) for at in (0.0, 1.0)]
    found = solve(Problem(cable=CABLE, grasps=grasps(*held), start=start), (0.0, 0.0, 0.0), extrapolate=False, path=compiled)
    assert found.outcome is Outcome.CONVERGED, found.sentence
    return found


def test_curvature_at_both_clamps_is_that_of_the_moment_to_second_order() -> None:
    moments = INTEGRATED.sol([0.0, 1.0])[7:9].T
    wanted = np.linalg.norm(moments / LAWS[:2], axis=1)
    errors = [np.abs(shape(segments).curvature[[0, -1]] - wanted).max() for segments in (24, 48, 96)]
    assert errors[0] < 2e-3 * wanted.max()
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.8).all()


def test_the_error_told_covers_the_curvature_everywhere() -> None:
    for segments in (24, 48, 96):
        found = shape(segments)
        wanted = np.linalg.norm(INTEGRATED.sol(found.s)[7:9].T / LAWS[:2], axis=1)
        assert found.error_curvature is not None
        assert np.abs(found.curvature - wanted).max() < found.error_curvature


@pytest.mark.parametrize("hold", [Hold.HINGE, Hold.CLAMP])
def test_an_end_without_a_moment_keeps_its_natural_curvature(hold: Hold) -> None:
    """An arc of a cable that is bent by nature, hinged at one end or free, and clamped along itself at the other."""
    natural = 2.0  # 1/m
    bent = Cable("cable", 1.0, 1e-3, 0.1, LAWS[0], LAWS[2], None, natural_curvature=(0.0, natural, 0.0))
    places = np.array([[0.0, 0.0, 0.0], [(1 - np.cos(natural)) / natural, 0.0, np.sin(natural) / natural]])
    turned = Rotation.from_rotvec([0.0, natural, 0.0]).as_quat()
    held = [(0.0, places[0], np.array([0.0, 0.0, 0.0, 1.0]), Hold.CLAMP)]
    if hold is Hold.HINGE:
        held.append((1.0, places[1], turned, hold))
    found = solve(Problem(cable=bent, grasps=grasps(*held)), (0.0, 0.0, 0.0), path=compiled)
    assert found.outcome is Outcome.CONVERGED, found.sentence
    assert found.curvature[-1] == pytest.approx(natural, rel=1e-12)
    assert found.curvature == pytest.approx(natural, rel=2e-3)  # by the tolerance

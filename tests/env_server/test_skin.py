"""Lists of what is near a cable save time and change nothing: every array of the candidates is the same, bit for bit, as without them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_touch import AT_REST, RADIUS, REACH, plate, straight
from trimesh import creation

from env_server import skin
from env_server.surface import Surface
from env_server.touch import Candidates, Touch


def bodies() -> Touch:
    ball, peg = creation.icosphere(4, 0.03), creation.cylinder(0.01, 0.2, sections=48)
    return Touch([Surface(*plate()), Surface(ball.vertices, ball.faces), Surface(peg.vertices, peg.faces)])


def assert_same(one: Candidates, other: Candidates) -> None:
    for name in Candidates._fields:
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


def postures(rng: np.random.Generator, nodes: int, bold: float) -> tuple[np.ndarray, np.ndarray]:
    """A cable through the middle of three bodies, and their poses (3, 7), all moved a little; `bold` [m] says by how much."""
    axis = straight((-0.08, 0.0, 0.0), (0.08, 0.0, 0.0), nodes - 1)
    axis += np.cumsum(rng.normal(size=axis.shape), axis=0) * bold / np.sqrt(nodes)
    poses = np.tile(AT_REST, (3, 1))
    poses[:, :3] = [[0.0, 0.0, -0.006], [0.05, 0.0, -0.03], [-0.04, 0.012, 0.0]] + rng.normal(size=(3, 3)) * bold
    poses[:, 3:] = Rotation.from_rotvec(rng.normal(size=(3, 3)) * bold / 0.05).as_quat()
    return axis, poses


@pytest.mark.parametrize("bold", [2e-4, 1e-3, 5e-3])  # lists kept mostly, partly, and seldom
def test_a_search_with_lists_gives_the_same_bits_while_everything_moves(bold: float) -> None:
    """The number of nodes, and how far is looked, change on the way."""
    listed, whole, rng, places, crossings = bodies(), bodies(), np.random.default_rng(4), 0, 0
    before = None
    for step in range(120):
        nodes, poses = postures(rng, 60 if 40 <= step < 80 else 30, bold)
        reach = REACH * (0.3 if step % 10 == 9 else 1.0)
        now = whole.search(nodes, poses, RADIUS, reach, previous=before)
        assert_same(now, listed.search(nodes, poses, RADIUS, reach, cable=0, previous=before))
        before = now
        places, crossings = places + len(now.gap), crossings + int(now.is_crossing.sum())
    assert places > 1000
    assert crossings > 0 or bold < 1e-3


def test_cables_keep_lists_of_their_own() -> None:
    listed, whole, rng = bodies(), bodies(), np.random.default_rng(5)
    for _ in range(30):
        nodes, poses = postures(rng, 30, 1e-3)
        for cable, axis in enumerate((nodes, nodes + np.array([0.0, 0.02, 0.01]), nodes[:11])):
            excluded = rng.random((len(axis) - 1, 3)) < 0.2
            found = listed.search(axis, poses, RADIUS, REACH, cable=cable, excluded=excluded)
            assert_same(found, whole.search(axis, poses, RADIUS, REACH, excluded=excluded))


@pytest.mark.thorough
def test_a_list_without_enough_room_is_not_used() -> None:
    ball = creation.icosphere(6, 0.01)  # 80 000 triangles within reach of each segment
    listed, whole = (Touch([Surface(ball.vertices, ball.faces)]) for _ in range(2))
    rng = np.random.default_rng(6)
    for _ in range(3):
        nodes = straight((-0.02, 0.0, 0.011), (0.02, 0.0, 0.011), 4) + 1e-4 * rng.normal(size=(5, 3))
        assert_same(whole.search(nodes, AT_REST, RADIUS, REACH), listed.search(nodes, AT_REST, RADIUS, REACH, cable=0))
    assert listed._listed[0].counts[skin.WIDE].min() == -1


def test_a_list_stays_valid_until_a_segment_has_left_its_region() -> None:
    touch, nodes = bodies(), straight((-0.08, 0.0, 0.0), (0.08, 0.0, 0.0), 8)
    poses = np.tile(AT_REST, (3, 1))
    touch.search(nodes, poses, RADIUS, REACH, cable=0)
    boxes = touch._listed[0].boxes[skin.WIDE]
    made = boxes.copy()
    touch.search(nodes + 0.99 * skin.SKINS[skin.WIDE], poses, RADIUS, REACH, cable=0)
    assert np.array_equal(boxes, made)
    poses[:, 1] -= 0.5 * skin.SKINS[skin.WIDE]  # a body counts as much as the cable
    touch.search(nodes + np.array([0.0, 0.6 * skin.SKINS[skin.WIDE], 0.0]), poses, RADIUS, REACH, cable=0)
    assert not np.array_equal(boxes, made)

"""Bodies out of reach of a cable cost nothing: not a triangle is looked at, and nothing of them goes over the wire."""

from __future__ import annotations

import numpy as np
from test_touch import AT_REST, RADIUS, REACH, plate, straight
from trimesh import creation

from env_server.surface import Surface
from env_server.touch import Touch


def test_no_triangle_of_a_body_out_of_reach_is_looked_at() -> None:
    """Its triangles are made unreadable: a search that read one would report it, or lose the other body's places."""
    ball = creation.icosphere(5, 0.05)
    touch = Touch([Surface(*plate()), Surface(ball.vertices, ball.faces)])
    poses = np.vstack([AT_REST, [[0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0]]])
    nodes = straight((-0.03, 0.0, 0.003), (0.03, 0.0, 0.003), 6)
    before = touch.search(nodes, poses, RADIUS, REACH)
    planes = touch._features.planes.copy()
    planes[touch._features.surfaces["first_triangle"][1] :] = np.nan
    boxes = touch._features.boxes.copy()
    boxes[touch._features.surfaces["first_box"][1] + 1 :] = np.nan  # all but the root
    object.__setattr__(touch, "_features", touch._features._replace(planes=planes, boxes=boxes))
    after = touch.search(nodes, poses, RADIUS, REACH)
    assert len(before.gap) > 0
    for name in ("gap", "body", "point", "clearance"):
        assert np.array_equal(getattr(before, name), getattr(after, name))

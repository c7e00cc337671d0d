from __future__ import annotations

import msgspec
import numpy as np
import pytest
from PIL import Image
from synthetic import SNAPSHOT, block, frame

from viz_client.picture import CONTACT_COLOR, Studio, draw, numbers
from viz_client.view import DIRECTIONS, MARGIN, View, fit_view

WIDTH, HEIGHT = 480, 300


def pixels(path) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB")).astype(int)


def is_orange(color: np.ndarray) -> np.ndarray:
    red, green, blue = np.moveaxis(color, -1, 0)
    return (red > 100) & (red > 1.5 * green) & (green > 1.5 * blue)


def test_a_picture_shows_the_solids_on_a_light_background(tmp_path):
    draw(SNAPSHOT, frame(0), tmp_path / "p.png", width=WIDTH, height=HEIGHT)
    picture = pixels(tmp_path / "p.png")
    assert picture.shape == (HEIGHT, WIDTH, 3)
    assert picture[0, 0].min() > 230
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 200


def test_the_cable_appears_where_its_projection_says(tmp_path):
    shown = frame(5, contacts=0)
    view = fit_view([shown], aspect=WIDTH / HEIGHT)
    draw(SNAPSHOT, shown, tmp_path / "p.png", width=WIDTH, height=HEIGHT, view=view)
    picture = pixels(tmp_path / "p.png")
    column, row, _ = view.pixels(shown.shapes[0].nodes[2:-4], WIDTH, HEIGHT).T  # the hand hides one end
    assert is_orange(picture[row.round().astype(int), column.round().astype(int)]).all()
    assert 0.003 < is_orange(picture).mean() < 0.1


def test_contacts_are_marked(tmp_path):
    shown = frame(5, contacts=1)
    view = fit_view([shown], aspect=WIDTH / HEIGHT)
    draw(SNAPSHOT, shown, tmp_path / "p.png", width=WIDTH, height=HEIGHT, view=view)
    column, row, _ = view.pixels(shown.touching.point, WIDTH, HEIGHT)[0]
    assert np.abs(pixels(tmp_path / "p.png")[round(row), round(column)] - CONTACT_COLOR).max() < 40


def test_what_hides_the_cable_is_looked_past(tmp_path):
    """A wall between the first choice of camera and the cable: another direction is taken."""
    wall = block("wall", (0.02, 1.5, 1.5))
    turn, dip = DIRECTIONS[0]
    towards = -np.array([np.cos(dip) * np.cos(turn), np.cos(dip) * np.sin(turn), -np.sin(dip)])
    half = 0.5 * turn
    pose = np.array([*(np.array([0.5, 0.0, 1.1]) + 0.5 * towards), 0.0, 0.0, np.sin(half), np.cos(half)])
    hidden = msgspec.structs.replace(frame(0), poses=np.vstack([frame(0).poses, pose]))
    walled = msgspec.structs.replace(SNAPSHOT, solids=(*SNAPSHOT.solids, wall))
    draw(walled, hidden, tmp_path / "p.png", width=WIDTH, height=HEIGHT)
    assert is_orange(pixels(tmp_path / "p.png")).mean() > 0.003
    draw(walled, hidden, tmp_path / "first.png", width=WIDTH, height=HEIGHT, view=fit_view([hidden], aspect=WIDTH / HEIGHT))
    assert is_orange(pixels(tmp_path / "first.png")).mean() < 0.002


def test_a_concave_solid_is_not_filled(tmp_path):
    """Looking through a square ring, the background is seen."""
    bars = [block("ring", size) for size in ((0.1, 1.0, 0.1), (0.1, 1.0, 0.1), (0.1, 0.1, 1.0), (0.1, 0.1, 1.0))]
    places = [(0, 0, 0.5), (0, 0, -0.5), (0, 0.5, 0), (0, -0.5, 0)]
    ring = msgspec.structs.replace(
        bars[0],
        vertices=np.concatenate([bar.vertices + place for bar, place in zip(bars, places, strict=True)]),
        triangles=np.concatenate([bar.triangles + 8 * i for i, bar in enumerate(bars)]),
    )
    alone = msgspec.structs.replace(frame(0, contacts=0), poses=np.array([[3.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]]))
    view = View(np.array([1.0, 0.0, 1.0]), np.array([3.0, 0.0, 1.0]), 0.8)
    draw(msgspec.structs.replace(SNAPSHOT, solids=(ring,)), alone, tmp_path / "p.png", width=200, height=200, view=view)
    picture = pixels(tmp_path / "p.png")
    assert picture[100, 100].min() > 200
    assert picture[100, 22:40].max(axis=1).min() < 200


def test_a_studio_draws_every_frame_afresh(tmp_path):
    with Studio(SNAPSHOT) as studio:
        view = fit_view([frame(0)], aspect=WIDTH / HEIGHT)
        for name, sequence in (("a", 0), ("b", 10), ("c", 0)):
            studio.draw(frame(sequence), tmp_path / name, width=WIDTH, height=HEIGHT, view=view)
    assert (pixels(tmp_path / "a") == pixels(tmp_path / "c")).all()
    assert (pixels(tmp_path / "a") != pixels(tmp_path / "b")).any()


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_view_holds_cable_and_grippers_with_a_margin(direction):
    shown = [frame(0), frame(10)]
    view = fit_view(shown, aspect=1.6, direction=direction)
    points = np.concatenate([f.shapes[0].nodes for f in shown] + [f.grasps[0].position for f in shown])
    column, row, ahead = view.pixels(points, 1600, 1000).T
    assert ahead.min() > 0
    assert column.min() >= 1600 * MARGIN
    assert column.max() <= 1600 * (1 - MARGIN)
    assert row.min() >= 1000 * MARGIN
    assert row.max() <= 1000 * (1 - MARGIN)
    assert max(np.ptp(column) / 1600, np.ptp(row) / 1000) > 0.35  # and fills it


def test_a_frame_between_two_equilibria_is_called_an_artificial_motion():
    """Its tension and contacts are those of no equilibrium."""
    assert "tension" in numbers(frame(0))
    line = numbers(msgspec.structs.replace(frame(0), relaxation=0.25))
    assert "artificial motion to the next equilibrium" in line
    assert "tension" not in line

"""Fig. 12 of the paper: points that scipy computed, and our curves."""

from __future__ import annotations

import measured_points
import numpy as np
import pytest
from taken import said

from scenarios.paper.fig_12_measured import distances


@pytest.mark.slow
def test_errors_are_within_those_of_the_paper_and_come_from_the_plastic_part() -> None:
    assert said("12")


def test_the_points_are_those_that_their_script_makes() -> None:
    made = [line.split(",") for line in measured_points.text().splitlines()]
    kept = [line.split(",") for line in measured_points.FILE.read_text().splitlines()]
    assert made[0] == kept[0]
    assert [row[0] for row in made] == [row[0] for row in kept]
    first, last = (np.array([[float(word) for word in row[1:]] for row in rows[1:]]) for rows in (made, kept))
    assert np.abs(first - last).max() < 2e-5  # rounded to 1e-5 m


def test_distances_are_to_the_nearest_place_of_a_chain() -> None:
    nodes = np.array([[0.0, 9.0, 0.0], [1.0, 9.0, 0.0], [1.0, 9.0, 1.0]])
    points = np.array([[0.5, 0.2, 0.0], [1.3, 0.5, 0.0], [-3.0, -4.0, 0.0]])
    assert distances(points, nodes) == pytest.approx([0.2, 0.3, 5.0])

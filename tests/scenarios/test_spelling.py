"""What somebody meant who wrote a name that there is not."""

from __future__ import annotations

import pytest

from protocol.scene import Cable, Section
from scenarios.quantity import fields_of
from scenarios.spelling import meant


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("bendin", "bending"),
        ("bending2", "bending_2"),
        ("bending_stifness", "bending"),
        ("bendin_stiffness", "bending"),
        ("bending_stiffness_2", "bending_2"),
        ("stretch_stiffness", "stretch"),
        ("twist_stiffness", "twist"),
        ("lenght", "length"),
        ("length_m", "length"),
        ("mass", "masses"),
        ("mass_length", "mass_per_length"),
        ("curvature", "natural_curvature"),
        ("natural_curvatures", "natural_curvature"),
        ("section", "sections"),
        ("young", None),
        ("x", None),
        ("", None),
    ],
)
def test_a_key_of_a_cable_that_there_is_not_is_understood_as_a_person_would(written: str, name: str | None) -> None:
    assert meant(written, fields_of(Cable)) == name


def test_a_word_that_is_only_a_part_of_a_name_does_not_stand_for_it() -> None:
    assert meant("length", fields_of(Section)) is None

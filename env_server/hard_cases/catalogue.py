"""All hard cases of the environment, family by family."""

from __future__ import annotations

from protocol.hard_case import Case

from . import crossing, draping, journeys, limp, meeting, meeting_itself, rubbing, triangles

FAMILIES = (meeting, triangles, rubbing, draping, meeting_itself, journeys, limp, crossing)


def catalogue() -> tuple[Case, ...]:
    """The cases of all families."""
    return tuple(case for module in FAMILIES for case in module.cases())

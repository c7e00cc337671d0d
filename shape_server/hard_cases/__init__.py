"""A catalogue of hard cases for the shape solver, each with a reference or an invariant of other making.

Every case ends in one of four ways: right within its tolerance; refused with a reason; outside what the model covers, and told so; or
wrong, which is what the catalogue is there to find: not finite, not stable, an error above the tolerance, an exception, a hang.
`python -m shape_server.hard_cases` runs it and prints a table.

Not covered, because the solver does not build it: friction coefficients (only F_0 and F_inf), contact of the cable with itself or
with another cable, bodies that move between two requests by themselves, plastic bending, dynamics after a snap.
"""

from __future__ import annotations

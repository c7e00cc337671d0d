"""A catalogue of hard cases for the shape solver, each with a reference or an invariant of other making.

Every case ends in one of four ways: right within its tolerance; refused with a reason; outside what the model covers, and told so; or
wrong, which is what the catalogue is there to find: not finite, not stable, an error above the tolerance, an exception, a hang.
Cases that take bodies, friction and steps are those of the environment.
"""

from __future__ import annotations

"""Kinds of contact, grasp and outcome, each with the paper's symbol and what it means."""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Final


class Friction(Enum):
    """How a body holds the cable along its surface."""

    BOND = "bond"  # F_inf
    NONE = "none"  # F_0
    REGULARIZED = "regularized"  # F_R: mu N v / sqrt(v^2 + v0^2) against the sliding
    SIGNUM = "signum"  # F_sigma: mu N against the sliding; sticks below that
    DEFINED = "defined"  # F_d: a table of sliding speed and normal force


FRICTION_CODES: Final[tuple[Friction, ...]] = (Friction.NONE, Friction.BOND, Friction.REGULARIZED, Friction.SIGNUM, Friction.DEFINED)
"""Friction kinds in the order of the codes that `Contacts.friction` carries."""

RUBS: Final = (2, 3, 4)
"""Codes of the kinds with a force along the surface, which depends on how far a contact slides."""


class SelfInteraction(Enum):
    """What becomes of a cable where it meets itself, or another cable of the same kind."""

    TRANSPARENT = "transparent"  # nothing: it passes through
    BOND = "bond"  # the two points stick where they first touch
    FICTITIOUS = "fictitious"  # it passes through, but bends no tighter than its bend radius, as if around an obstacle
    CONTACT = "contact"  # one-sided, without friction


class SelfTouch(IntEnum):
    """How two places of one cable or of two meet: the codes of `SelfContacts.kind` and `Crossings.kind`."""

    CONTACT = 0  # one-sided; both places slide to where they are nearest, the first within half a segment of its node
    BOND = 1  # both surfaces stick together at a point, about which they turn; among crossings only


class Inclination(Enum):
    """Whether a body dictates the tangent of a cable where it is bonded to it."""

    FREE = "free"  # G_0: the mechanics choose
    FIXED = "fixed"  # G_inf: square to the body's normal


INCLINATION_CODES: Final[tuple[Inclination, ...]] = (Inclination.FREE, Inclination.FIXED)
"""Kinds of inclination in the order of the codes that `Contacts.inclination` carries."""


class Hold(Enum):
    """What a gripper fixes at the point of the cable that it holds."""

    CLAMP = "clamp"  # position and frame
    HINGE = "hinge"  # position only
    GUIDE = "guide"  # frame, and position but for sliding along the tangent, as in a sleeve


class Primitive(Enum):
    """A body that is given by its sizes, about its position, with its axis along its own z."""

    SPHERE = "sphere"
    CYLINDER = "cylinder"  # its side; the ends are not built, and a cable that comes to them is refused
    CAPSULE = "capsule"  # a cylinder that ends in half spheres
    PLANE = "plane"  # all below its own x-y plane is solid
    POINT = "point"


class Model(Enum):
    """The ladder of models, from cheap to complete."""

    AUTO = "auto"  # the cheapest that keeps the tolerance
    TAUT = "taut"  # straight line
    CATENARY = "catenary"  # no bending
    GRADIENT = "gradient"  # the paper's moment-accepting cable: planar, moderate slopes
    ROD = "rod"  # everything


class Feature(IntEnum):
    """Part of a body's surface that a contact point lies on."""

    FACE = 0
    EDGE = 1
    VERTEX = 2


class Outcome(Enum):
    """How a request for a shape ended; `advice` says what to try next."""

    CONVERGED = "converged"
    UNREACHABLE = "unreachable"
    NOT_CONVERGED = "not_converged"
    UNSTABLE = "unstable"
    UNSUPPORTED = "unsupported"

    @property
    def advice(self) -> str:
        """What to try next, as a sentence."""
        return _ADVICE[self]


_ADVICE: Final = {
    Outcome.CONVERGED: "Nothing to do: a stable equilibrium within the residual asked for.",
    Outcome.UNREACHABLE: "Bring the held points closer together along the cable, or make the cable longer.",
    Outcome.NOT_CONVERGED: "Move the grippers in smaller steps; if a start shape was given, ask again without it.",
    Outcome.UNSTABLE: "Twist or press the cable less, pull it more, or ask with a start shape that is near the one looked for.",
    Outcome.UNSUPPORTED: "Leave out or change the part of the request that the sentence names.",
}

"""Twist: torque GJ times the rate of turn of the section about the tangent.

Energy GJ/2 kappa_3^2 per metre (Saint-Venant; Antman 2005, "Nonlinear Problems of Elasticity", ch. 8). Warping is left
out; it vanishes for a round section.
"""

from __future__ import annotations

from protocol.scene import Cable


def stiffness(cable: Cable) -> tuple[float, float, float]:
    """Share of the diagonal law for (curvature, curvature, twist), [N m^2]."""
    assert cable.twist is not None
    return (0.0, 0.0, cable.twist)

"""Bending: moment EI times curvature, the same about both axes of a round section.

Energy EI/2 (kappa_1^2 + kappa_2^2) per metre (Euler-Bernoulli; Antman 2005, "Nonlinear Problems of Elasticity", ch. 8).
Shear and the slip of wires inside a bundle are left out; a bundle of loose wires is softer than its bonded section by a
factor that the scene's number must already hold.
"""

from __future__ import annotations

from protocol.scene import Cable


def stiffness(cable: Cable) -> tuple[float, float, float]:
    """Share of the diagonal law for (curvature, curvature, twist), [N m^2]."""
    assert cable.bending is not None
    return (cable.bending, cable.bending, 0.0)

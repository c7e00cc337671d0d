"""Coulomb's friction (F_sigma): |t| <= mu N; what slides bears mu N against the sliding, what does not sticks for ever.

Source: the paper's sec. 3.1, after Stein, Zahoransky and Mucka 2008, J. Sound Vib. 311, 74-96; the law is Coulomb's, 1785. The friction
of rest is taken equal to that of sliding; a higher one is a table (`defined`).
"""

from __future__ import annotations

from protocol.messages import FrictionLaw

from . import Numbers


def numbers(law: FrictionLaw) -> Numbers:
    """F(v, N) = mu N."""
    return Numbers(law.coefficient, 0.0)

"""The border of the system: rows of held points, contacts and curved features, on the way to `closing`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Border:
    """Rows in the order: held points, contacts, curvature."""

    count: int
    element: np.ndarray  # (count,) int
    fraction: np.ndarray  # (count,)
    vector: np.ndarray  # (count, 3)
    is_turn: np.ndarray  # (count,) int
    compliance: np.ndarray  # (count, count)
    residual: np.ndarray  # (count,)
    contacts: np.ndarray  # (c,) int, which contacts have a row
    first_contact: int
    saddles: int  # negative directions that the curvature rows bring with them
    is_exact: bool


@dataclass(frozen=True)
class Curvature:
    """Rows that carry the curvature of edges and vertices, see `contact_geometry`."""

    contact: list[int]
    vector: np.ndarray  # (rows, 3)
    is_turn: np.ndarray  # (rows,) int
    compliance: np.ndarray  # (rows, rows)
    saddles: int


def curvature_rows(
    slide: np.ndarray, across: np.ndarray, normal: np.ndarray, numbers: np.ndarray, push: np.ndarray, curved: list[int]
) -> Curvature:
    """Rows for the contacts named in `curved`, with the inverse of minus the force times the second derivative as compliance.

    A sliding contact has a block over the rows (a, b_) = (m . dc, n . dt), which brings one negative direction: without a bulge
    it is [[-d, mu], [mu, 0]] / force. Any other row has -d / force.
    """
    contact: list[int] = []
    vector: list[np.ndarray] = []
    turned: list[int] = []
    blocks: list[np.ndarray] = []
    saddles = 0
    for c in curved:
        mu, distance, _, curve = numbers[c]
        bend = distance / push[c]
        if mu != 0.0:
            contact += [c, c]
            vector += [slide[c], normal[c]]
            turned += [0, 1]
            own, cross = curve / mu**2, 1.0 / mu + curve * distance / mu**3
            turn = distance / mu**2 + curve * distance**2 / mu**4
            blocks.append(np.array([[turn, -cross], [-cross, own]]) / (push[c] * (own * turn - cross**2)))
            saddles += 1
        else:
            contact.append(c)
            vector.append(slide[c])
            turned.append(0)
            blocks.append(np.array([[-bend]]))
        if across[c].any():
            contact.append(c)
            vector.append(across[c])
            turned.append(0)
            blocks.append(np.array([[-bend]]))
    compliance = np.zeros((len(contact), len(contact)))
    at = 0
    for block in blocks:
        compliance[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return Curvature(contact, np.array(vector).reshape(-1, 3), np.array(turned, dtype=np.int64), compliance, saddles)

"""Friction (F_R, F_sigma, F_d): a force along the surface against the sliding of a contact; the normal force is that of `contact`.

Two rows for each contact, along two directions square to its normal: how far the material point has gone from where the request
says that it was held. What force that brings is the matter of the laws in `contacts` and of `drag`; one that is zero has no rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from protocol.kinds import FRICTION_CODES
from protocol.messages import Contacts, Rubbed

from ..contact_geometry import EDGE
from ..contacts import Numbers, numbers_of
from ..mesh import Mesh
from ..rod import RUB, Rub, from_columns


@dataclass(frozen=True)
class Laws:
    """The contacts of a request that rub, and their laws; the same for every mesh."""

    row: np.ndarray  # (f,) int, rows of the request's `rubbing`
    of_row: list[Numbers]  # (f,)


def laws(contacts: Contacts) -> Laws:
    """Laws of all contacts that rub, those left out whose friction is zero."""
    rubbing = contacts.rubbing
    assert rubbing is not None
    of_row = [
        numbers_of(FRICTION_CODES[contacts.friction[contact]], rubbing.laws[law])
        for contact, law in zip(rubbing.contact.tolist(), rubbing.law.tolist(), strict=True)
    ]
    kept = [k for k, own in enumerate(of_row) if own.coefficient > 0.0 or (own.table is not None and own.table[2].any())]
    return Laws(np.array(kept, dtype=np.int64), [of_row[k] for k in kept])


def rows(contacts: Contacts, chosen: Laws, mesh: Mesh) -> tuple[Rub, np.ndarray]:
    """Rows of the contacts that rub, and their forces (f, 2) [N] to start from."""
    rubbing = contacts.rubbing
    assert rubbing is not None
    contact = rubbing.contact[chosen.row]
    element, fraction = mesh.locate(rubbing.s[chosen.row])
    axes = _axes(contacts, contact)
    tables: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    table = np.full(len(contact), -1, dtype=np.int64)
    for k, own in enumerate(chosen.of_row):
        if own.table is not None:
            known = next((place for place, one in enumerate(tables) if one[0] is own.table[0]), len(tables))
            tables += [own.table] if known == len(tables) else []
            table[k] = known
    of_rows = {
        "contact": contact,
        "element": element,
        "fraction": fraction,
        "axes": axes,
        "anchor": rubbing.anchor[chosen.row],
        "coefficient": np.array([own.coefficient for own in chosen.of_row]),
        "speed": np.array([own.speed for own in chosen.of_row]),
        "table": table,
    }
    return Rub(from_columns(RUB, of_rows), _padded(tables), rubbing.time_step), np.einsum("fax,fx->fa", axes, contacts.force[contact])


def rubbed(contacts: Contacts, chosen: Laws, rub: Rub, s: np.ndarray, places: np.ndarray, lag: np.ndarray, sticks: np.ndarray) -> Rubbed:
    """What is left of the contacts of a request.

    Args:
        contacts: Of the request.
        chosen: Which of them have rows.
        rub: These rows.
        s: (f,) [m] Where along the cable the contacts are that have rows.
        places: (f, 3) [m] Points of the axis there.
        lag: (f, 3) [m] How far the anchor of a point that slides stays behind it, which is what holds it when it comes to rest.
        sticks: (f,) bool.
    """
    rubbing = contacts.rubbing
    assert rubbing is not None
    out_s, anchor = rubbing.s.copy(), rubbing.anchor.copy()
    is_sticking = np.zeros(len(out_s), dtype=np.int64)
    slides = chosen.row[~sticks]
    out_s[slides], anchor[slides] = s[~sticks], (places + lag)[~sticks]
    is_sticking[chosen.row[sticks]] = 1
    return Rubbed(s=out_s, anchor=anchor, is_sticking=is_sticking)


def _axes(contacts: Contacts, contact: np.ndarray) -> np.ndarray:
    """Two directions along the surface of every contact (f, 2, 3); all laws are the same in any direction, so any two will do."""
    normal, is_edge = contacts.normal[contact], contacts.feature[contact] == EDGE
    first = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first[is_edge] = contacts.direction[contact][is_edge]
    first = first - np.einsum("fx,fx->f", first, normal)[:, None] * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.ascontiguousarray(np.stack([first, np.cross(normal, first)], axis=1))


def _padded(tables: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> np.ndarray:
    """All tables as `Rub` has them, (t, 1 + k, 1 + q)."""
    most = np.array([own[2].shape for own in tables], dtype=np.int64).reshape(-1, 2).max(axis=0, initial=0)
    out = np.full((len(tables), 1 + most[0], 1 + most[1]), np.nan)
    for place, (speed, normal, force) in enumerate(tables):
        out[place, 1 : 1 + len(speed), 0], out[place, 0, 1 : 1 + len(normal)] = speed, normal
        out[place, 1 : 1 + len(speed), 1 : 1 + len(normal)] = force
    return out

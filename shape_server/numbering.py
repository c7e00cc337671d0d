"""The numbers of the rows of several rods in the one dense system that they share, see `coupled`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

Array = np.ndarray


class Numbering:
    """The numbers of all rows in the order of `closing`: held points and knots, contacts, curvature."""

    def __init__(self, borders: Sequence[Any], ties: int, crossings: int, shared: int) -> None:
        held = [len(border.held) for border in borders]
        touching = [len(border.contacts) for border in borders]
        rest = [len(border.element) - h - c for border, h, c in zip(borders, held, touching, strict=True)]
        first = sum(held) + ties
        self.contacts = slice(first, first + sum(touching) + crossings)
        count = self.contacts.stop + sum(rest) + shared - ties - crossings
        self.matrix, self.right = np.zeros((count, count)), np.zeros(count)
        self.own: list[Array] = []
        a, b, c = 0, first, self.contacts.stop
        for h, t, r in zip(held, touching, rest, strict=True):
            self.own.append(np.concatenate([np.arange(a, a + h), np.arange(b, b + t), np.arange(c, c + r)]))
            a, b, c = a + h, b + t, c + r
        self.shared = np.concatenate([np.arange(a, a + ties), np.arange(b, b + crossings), np.arange(c, count)])

"""The numbers of the rows of several rods in the one dense system that they share, see `coupled`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

Array = np.ndarray


class Numbering:
    """The numbers of all rows in the order of `stick_slip`: held points and knots, contacts, curvature, two of each contact that rubs."""

    def __init__(self, borders: Sequence[Any], ties: int, crossings: int, curved: int, rubs: int) -> None:
        held = [len(border.held) for border in borders]
        touching = [len(border.contacts) for border in borders]
        rubbing = [2 * len(border.rubs) for border in borders]
        rest = [len(border.element) - h - t - r for border, h, t, r in zip(borders, held, touching, rubbing, strict=True)]
        first = sum(held) + ties
        self.contacts = slice(first, first + sum(touching) + crossings)
        last = self.contacts.stop + sum(rest) + curved
        count = last + sum(rubbing) + 2 * rubs
        self.rubs = slice(last, count)
        self.matrix, self.right = np.zeros((count, count)), np.zeros(count)
        self.own: list[Array] = []
        at = [0, first, self.contacts.stop, last]
        for sizes in zip(held, touching, rest, rubbing, strict=True):
            self.own.append(np.concatenate([np.arange(begin, begin + size) for begin, size in zip(at, sizes, strict=True)]))
            at = [begin + size for begin, size in zip(at, sizes, strict=True)]
        sizes = (ties, crossings, curved, 2 * rubs)
        self.shared = np.concatenate([np.arange(begin, begin + size) for begin, size in zip(at, sizes, strict=True)])

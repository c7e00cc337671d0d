"""The name that somebody meant who wrote another one: misspelt, or with a word too many."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Final

NEAR: Final = 0.8  # share of letters in common, in order: so near to a name, or to one of its words, that it is this one
LIKE: Final = 0.6  # the same for a name to be worth a question


def meant(written: str, names: Iterable[str]) -> str | None:
    """The name that was meant; None if none is like it.

    A name whose every word was written goes before one that has more letters in common, so that `bending_stiffness` means
    `bending` and not `bending_2`; of several such names the one with the most words.
    """
    known = list(names)
    misspelt = difflib.get_close_matches(written, known, 1, NEAR)
    if misspelt:
        return misspelt[0]
    words = written.split("_")
    within = [name for name in known if all(difflib.get_close_matches(word, words, 1, NEAR) for word in name.split("_"))]
    within.sort(key=lambda name: (name.count("_"), difflib.SequenceMatcher(None, name, written).ratio()))
    return within[-1] if within else next(iter(difflib.get_close_matches(written, known, 1, LIKE)), None)

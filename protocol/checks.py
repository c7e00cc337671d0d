"""Checks of what a message holds; each raises a `MessageError` that names the field."""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache
from typing import Final

import numpy as np

from .cable import FORCE_MAX, LENGTH_MAX, MASS_MAX, STIFFNESS_MAX, Cable, LumpedMass, Section, cable_mistakes
from .errors import MessageError

NODES_MAX: Final = 20_000
CONTACTS_MAX: Final = 5_000
GRASPS_MAX: Final = 100
HUGE: Final = 1e12  # in any unit; a number beyond this is a mistake
EXTENT_MAX: Final = 1e4  # m; a coordinate beyond this is a mistake, not a scene
UNIT: Final = 1e-6  # off the square of a unit vector


@lru_cache(maxsize=64)
def check_cable(cable: Cable) -> None:
    """Check the numbers of a cable that came over the wire; the same cable comes with every step, and passes only once."""
    _check_numbers("cable", cable)
    for name, sentence in cable_mistakes(cable):
        raise MessageError(f"cable.{sentence}", key=f"cable.{name}")
    for index, section in enumerate(cable.sections):
        _check_numbers(f"cable.sections[{index}]", section)
    for index, mass in enumerate(cable.masses):
        _check_numbers(f"cable.masses[{index}]", mass)


def _check_numbers(key: str, value: Cable | Section | LumpedMass) -> None:
    """Check every number against the range that its unit has."""
    for field in fields(value):
        number, (unit, most) = getattr(value, field.name), _RANGES.get(field.name, ("", HUGE))
        may_be_zero = field.name in ("mass_per_length", "at", "start")
        if isinstance(number, float) and not ((number >= 0.0 if may_be_zero else number > 0.0) and number <= most):
            sentence = f"{key}.{field.name}: {number!r} must be {'0 or more' if may_be_zero else 'positive'}, and at most {most:g} {unit}"
            raise MessageError(sentence, key=f"{key}.{field.name}")


_RANGES: Final = {
    **dict.fromkeys(("length", "diameter", "micro_length", "bend_radius", "start", "end", "at"), ("m", LENGTH_MAX)),
    **dict.fromkeys(("bending", "bending_2", "twist"), ("N m^2", STIFFNESS_MAX)),
    "stretch": ("N", FORCE_MAX),
    "mass_per_length": ("kg/m", MASS_MAX),
    "mass": ("kg", MASS_MAX),
}


def check_count(key: str, count: int, most: int) -> None:
    """Refuse more entries than a message may have."""
    if count > most:
        raise MessageError(f"{key}: {count} entries are too many; at most {most}", key=key)


def check_floats(key: str, array: np.ndarray, shape: tuple[int, ...], most: float) -> None:
    """Refuse an array that is not <f8 of that shape, finite, and below `most` in size."""
    if array.dtype != np.float64 or array.shape != shape:
        raise MessageError(f"{key}: {array.dtype.str} of shape {array.shape} must be <f8 of shape {shape}", key=key)
    # Most arrays are told by the sum of their squares, in an eighth of the time. A comparison with NaN is false: both tests cover it.
    if array.size and not np.vdot(array, array) < most * most and not max(array.max(), -array.min()) < most:
        raise MessageError(f"{key}: holds a value that is not finite, or not below {most:g}", key=key)


def check_units(key: str, array: np.ndarray) -> None:
    """Refuse vectors that are not of length 1."""
    if not _are_units(array):
        raise MessageError(f"{key}: every vector must have length 1 to within 5e-7", key=key)


def is_growing(array: np.ndarray) -> bool:
    """Whether every entry is greater than the one before."""
    return bool((array[1:] > array[:-1]).all())


def _are_units(array: np.ndarray) -> bool:
    """Whether the squares of all rows are 1 to within 1e-6; false where one is not finite."""
    off = np.einsum("ij,ij->i", array, array) - 1.0
    return not len(array) or bool(np.dot(off, off) <= UNIT**2 or np.abs(off).max() <= UNIT)


def check_integers(key: str, array: np.ndarray, count: int, low: int, high: int) -> None:
    """Refuse an array that is not <i8 with `count` entries within bounds."""
    if array.dtype != np.int64 or array.shape != (count,):
        raise MessageError(f"{key}: {array.dtype.str} of shape {array.shape} must be <i8 of shape ({count},)", key=key)
    if count and not low <= array.min() <= array.max() <= high:
        raise MessageError(f"{key}: values must lie within {low} and {high}", key=key)


def check_quaternions(key: str, array: np.ndarray, count: int) -> None:
    """Refuse an array that is not `count` unit quaternions."""
    check_floats(key, array, (count, 4), 2.0)
    if not _are_units(array):
        raise MessageError(f"{key}: every quaternion must have length 1 to within 5e-7", key=key)

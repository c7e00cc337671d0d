"""The kinds, their values on the wire, and what is said about each."""

from __future__ import annotations

import inspect

import protocol
from protocol import errors
from protocol.kinds import FRICTION_CODES, Feature, Friction, Hold, Model, Outcome


def test_every_outcome_says_what_to_try_next() -> None:
    assert all(outcome.advice.endswith(".") for outcome in Outcome)
    assert len({outcome.advice for outcome in Outcome}) == len(Outcome)


def test_the_values_on_the_wire_are_these() -> None:
    """A change here is a change of the protocol: raise `protocol.VERSION` with it."""
    assert protocol.VERSION == 5
    assert [outcome.value for outcome in Outcome] == ["converged", "unreachable", "not_converged", "unstable", "unsupported"]
    assert [hold.value for hold in Hold] == ["clamp", "hinge", "guide"]
    assert [model.value for model in Model] == ["auto", "taut", "catenary", "gradient", "rod"]
    assert [friction.value for friction in FRICTION_CODES] == ["none", "bond", "regularized", "signum", "defined"]
    assert set(FRICTION_CODES) == set(Friction)
    assert [(feature.name, feature.value) for feature in Feature] == [("FACE", 0), ("EDGE", 1), ("VERTEX", 2)]


def test_every_error_of_ours_stands_in_the_tree_and_carries_a_key() -> None:
    kinds = [kind for _, kind in inspect.getmembers(errors, inspect.isclass) if kind.__module__ == errors.__name__]
    for kind in kinds:
        assert issubclass(kind, errors.CablecosimError)
        assert kind.__name__ in (errors.__doc__ or "")
        assert kind("a sentence", key="a.key").key == "a.key"

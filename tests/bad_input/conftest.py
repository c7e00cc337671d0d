"""The place that every test of bad input works in."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from asking import Place, place


@pytest.fixture
def here() -> Iterator[Place]:
    with place() as made:
        yield made

from __future__ import annotations

from collections.abc import Iterator

import programs
import pytest

from protocol.channel import Client


@pytest.fixture
def box() -> Iterator[programs.Box]:
    """Folder of one test, whose programs end with it."""
    with programs.box() as made:
        yield made


@pytest.fixture(scope="module")
def shape() -> Iterator[str]:
    """Address of a shape server that all tests of a file share; it keeps nothing between requests."""
    with programs.box() as made:
        made.shape_server()
        client = Client(made.at("shape"), "test")
        client.greet(programs.LIMIT)
        client.close()
        yield made.at("shape")

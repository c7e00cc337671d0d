"""Programs that speak different versions, or are of another project, refuse each other with a sentence."""

from __future__ import annotations

import pytest
from programs import LIMIT, Box

from protocol.channel import Client
from protocol.messages import Error, Hello, Welcome


@pytest.mark.thorough
@pytest.mark.parametrize("server", ["shape_server", "env_server"])
@pytest.mark.parametrize(
    ("hello", "sentence"),
    [
        (Hello(version=999, role="env_server"), "the peer 'env_server' speaks version 999 of 'cablecosim', this program version 5"),
        (
            Hello(version=5, role="a viewer", project="protocol"),
            "the peer 'a viewer' speaks version 5 of 'protocol', this program version 5",
        ),
    ],
)
def test_another_version_or_project_is_refused_and_the_right_one_still_served(
    box: Box, shape: str, server: str, hello: Hello, sentence: str
) -> None:
    if server == "env_server":
        box.env_server(shape)
    address = shape if server == "shape_server" else box.at("control")
    client = Client(address, "test")
    answer = client.ask(hello, LIMIT)
    assert isinstance(answer, Error)
    assert answer.code == "version"
    assert answer.sentence.startswith(sentence)
    assert isinstance(client.greet(LIMIT), Welcome)
    client.close()

"""docs/protocol.md is complete: every message and field stands there, and its examples are real."""

from __future__ import annotations

import json
import re
from dataclasses import fields, is_dataclass
from typing import Any, get_args

import msgpack
import msgspec
import pytest
from rooms import ROOT

from protocol import VERSION, channel, kinds, messages, scene
from protocol.codec import decode, encode
from protocol.messages import AnyMessage, Hello, Message, Part, ShapeRequest
from shape_server import numpy_path
from shape_server.solve import solve

PAGE = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
MESSAGES = [kind for kind in get_args(AnyMessage)]
PARTS = [kind for kind in vars(messages).values() if isinstance(kind, type) and issubclass(kind, Part) and kind is not Part]
SCENES = [kind for kind in vars(scene).values() if isinstance(kind, type) and is_dataclass(kind) and kind.__module__ == scene.__name__]


def section(name: str) -> str:
    """What the page says about a message or a part of one, up to the next."""
    found = re.search(rf"^(### (?:.*\b)?{name}\b.*|.*\*\*{name}\*\*:.*)$", PAGE, re.MULTILINE)
    assert found, f"{name} has no section"
    rest = PAGE[found.start() :].split(f"**{name}**:")[-1] if "###" not in found[0] else PAGE[found.end() :]
    return re.split(r"\n##|\n\*\*[A-Z]|\*\*[A-Z]\w+\*\*:", rest)[0]


@pytest.mark.parametrize("kind", [*MESSAGES, *PARTS], ids=lambda kind: kind.__name__)
def test_every_field_of_every_message_has_a_row(kind: type[msgspec.Struct]) -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \|", section(kind.__name__), re.MULTILINE)
    assert [name for name, _ in rows] == list(kind.__struct_fields__)
    for (name, words), field in zip(rows, msgspec.structs.fields(kind), strict=True):
        default = re.search(r"= (.+)$", words)
        assert (default is None) == (field.default is msgspec.NODEFAULT), name
        if default is not None:
            assert default[1].strip("`").strip('"') == str(field.default), name
        if field.type.__name__ == "ndarray" if isinstance(field.type, type) else False:
            assert re.match(r"\([\w,\- ]+\) <[fi]8", words), name


@pytest.mark.parametrize("kind", [kind for kind in SCENES if kind is not scene.Unit], ids=lambda kind: kind.__name__)
def test_every_field_of_a_scene_is_named(kind: Any) -> None:
    for field in fields(kind):
        assert f"`{field.name}`" in section(kind.__name__), field.name


def test_no_message_is_forgotten() -> None:
    ours = {kind for kind in vars(messages).values() if isinstance(kind, type) and issubclass(kind, Message) and kind is not Message}
    assert ours == set(MESSAGES)


def test_the_page_is_of_this_version_and_has_its_limits() -> None:
    assert f"version **{VERSION}**" in PAGE
    for limit in (messages.NODES_MAX, messages.CONTACTS_MAX, messages.GRASPS_MAX, channel.HEARTBEAT, 3 * channel.HEARTBEAT):
        assert str(limit) in PAGE
    assert f"{channel.SIZE_MAX // 2**20} MiB" in PAGE
    assert f"{channel.SNAPSHOT_SIZE_MAX // 2**20} MiB" in PAGE
    for kind in (kinds.Outcome, kinds.Hold, kinds.Friction):
        for member in kind:
            assert re.search(rf"`\"?{member.value}\"?`", PAGE), member


def test_the_waits_on_the_page_are_those_of_the_programs() -> None:
    from env_server import __main__, asking, server
    from viz_client import client

    waits = re.findall(r"^\| [^|]+ \| (\d+) s \|", PAGE, re.MULTILINE)
    patience = __main__._parser().get_default("patience")
    of_environment = (patience, asking.SILENCE, patience, server.RECORDERS_LIMIT, server.LINGER)
    assert [float(wait) for wait in waits] == [*of_environment, client.START_LIMIT, client.SILENCE]


def test_the_hello_on_the_page_is_one() -> None:
    (data,) = (bytes.fromhex(block) for block in blocks("hex"))
    assert data == msgpack.packb(json.loads(blocks("json")[0]))
    assert decode(data) == Hello(version=2, role="me")


def test_the_request_on_the_page_gives_the_answer_that_it_promises() -> None:
    request = decode(msgpack.packb(with_bytes(json.loads(blocks("json")[1]))))
    assert isinstance(request, ShapeRequest)
    assert decode(encode(request)).step == 0
    shape = solve(request.problems[0], request.gravity, tolerance=request.tolerance, path=numpy_path)
    assert shape.model == "catenary"
    assert shape.outcome is kinds.Outcome.CONVERGED
    assert shape.grasp_wrenches[0, 2] == pytest.approx(0.4905)


def test_the_links_on_the_page_lead_somewhere() -> None:
    heads = {re.sub(r"[^a-z0-9 -]", "", head.lower()).replace(" ", "-") for head in re.findall(r"^#+ (.+)$", PAGE, re.MULTILINE)}
    assert set(re.findall(r"\]\(#([^)]+)\)", PAGE)) <= heads
    for path in re.findall(r"`((?:protocol|tests)/[\w/.]+)`", PAGE):
        assert (ROOT / path).is_file(), path


def blocks(language: str) -> list[str]:
    """Code on the page."""
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def with_bytes(value: Any) -> Any:
    """The request as it is sent, its `hex:` texts as bytes."""
    if isinstance(value, dict):
        return {key: with_bytes(item) for key, item in value.items()}
    if isinstance(value, list):
        return [with_bytes(item) for item in value]
    return bytes.fromhex(value.removeprefix("hex:")) if isinstance(value, str) and value.startswith("hex:") else value

"""docs/protocol.md is complete: every message and field stands there, and its examples are real."""

from __future__ import annotations

import json
import math
import re
from dataclasses import MISSING, fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import msgpack
import msgspec
import pytest
from annotated_types import Le
from rooms import ROOT

from protocol import VERSION, cable, channel, kinds, messages, parts, scene
from protocol.codec import decode, encode
from protocol.messages import AnyMessage, Hello, Message, Part, ShapeRequest
from shape_server import numpy_path
from shape_server.solve import solve

PAGE = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
MESSAGES = [kind for kind in get_args(AnyMessage)]
PARTS = [kind for kind in vars(messages).values() if isinstance(kind, type) and issubclass(kind, Part) and kind is not Part]
SCENES = [kind for kind in vars(scene).values() if isinstance(kind, type) and is_dataclass(kind) and kind.__module__ == scene.__name__]
CABLES = [scene.Cable, scene.Section, scene.LumpedMass]


def section(name: str) -> str:
    """What the page says about a message or a part of one, up to the next."""
    found = re.search(rf"^(### (?:.*\b)?{name}\b.*|.*\*\*{name}\*\*:.*)$", PAGE, re.MULTILINE)
    assert found, f"{name} has no section"
    rest = PAGE[found.start() :].split(f"**{name}**:")[-1] if "###" not in found[0] else PAGE[found.end() :]
    return re.split(r"\n##|\n\*\*[A-Z]|\*\*[A-Z]\w+\*\*:", rest)[0]


@pytest.mark.parametrize("kind", [*MESSAGES, *PARTS], ids=lambda kind: kind.__name__)
def test_every_field_of_every_message_has_a_row(kind: type[msgspec.Struct]) -> None:
    rows = rows_of(kind.__name__)
    assert [name for name, _, _ in rows] == list(kind.__struct_fields__)
    for (name, words, _), field in zip(rows, msgspec.structs.fields(kind), strict=True):
        assert default_in(words) == (None if field.default is msgspec.NODEFAULT else as_written(field.default)), name
        if field.type.__name__ == "ndarray" if isinstance(field.type, type) else False:
            assert re.match(r"\([\w,\- ]+\) <[fi]8", words), name


@pytest.mark.parametrize("kind", CABLES, ids=lambda kind: kind.__name__)
def test_every_number_of_a_cable_has_a_row_with_its_unit_its_default_and_its_bound(kind: Any) -> None:
    rows, hints = rows_of(kind.__name__), get_type_hints(kind, include_extras=True)
    assert [name for name, _, _ in rows] == [field.name for field in fields(kind)]
    for (name, words, meaning), field in zip(rows, fields(kind), strict=True):
        assert default_in(words) == (None if field.default is MISSING else as_written(field.default)), name
        for note in notes(hints[name]):
            if isinstance(note, scene.Unit):
                assert meaning.startswith(f"{note.name},"), name
            if isinstance(note, Le):
                assert re.search(rf"(to|at most) (1e{round(math.log10(note.le))}\b|the cable's length)", meaning), name


@pytest.mark.parametrize("kind", SCENES, ids=lambda kind: kind.__name__)
def test_every_field_of_a_scene_is_named(kind: Any) -> None:
    for field in fields(kind):
        assert f"`{field.name}`" in section(kind.__name__), field.name


def test_no_message_is_forgotten() -> None:
    ours = {kind for kind in vars(messages).values() if isinstance(kind, type) and issubclass(kind, Message) and kind is not Message}
    assert ours == set(MESSAGES)


def test_the_page_is_of_this_version_and_has_its_limits() -> None:
    assert f"version **{VERSION}**" in PAGE
    assert set(re.findall(r"\"version\": (\d+)", PAGE)) == {str(VERSION)}
    limits = {
        "grasps": messages.GRASPS_MAX,
        "contacts": messages.CONTACTS_MAX,
        "point loads": messages.CONTACTS_MAX,
        "sections": cable.SECTIONS_MAX,
        "lumped masses": cable.SECTIONS_MAX,
        "nodes": messages.NODES_MAX,
        "turns": parts.TURNS_MAX,
        "branch": parts.BRANCHES_MAX,
    }
    for what, limit in limits.items():
        assert re.search(rf"^\| [^|]*\b{what}\b[^|]* \| {limit} \|", PAGE, re.MULTILINE), what
    for wait in (channel.HEARTBEAT, 3 * channel.HEARTBEAT):
        assert str(wait) in PAGE
    assert f"{channel.SIZE_MAX // 2**20} MiB" in PAGE
    assert f"{channel.SNAPSHOT_SIZE_MAX // 2**20} MiB" in PAGE
    for kind in (kinds.Outcome, kinds.Hold, kinds.Friction, kinds.Model):
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
    assert decode(data) == Hello(version=5, role="me")


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


def rows_of(name: str) -> list[tuple[str, str, str]]:
    """Field, type and meaning of every row of the first table about a message or a part of one."""
    table = re.search(r"(?:^\| .*\n)+", section(name), re.MULTILINE)
    return re.findall(r"^\| `(\w+)` \| ([^|]+) \| (.*?) ?\|$", table[0] if table else "", re.MULTILINE)


def default_in(words: str) -> str | None:
    """What a row says that its field is unless it is given."""
    found = re.search(r"= (.+)$", words)
    return found[1].strip("`") if found else None


def as_written(default: Any) -> str:
    """A default as the page writes it."""
    return "None" if default is None else json.dumps(msgspec.to_builtins(default))


def notes(hint: Any) -> list[Any]:
    """Unit and bounds at a field, also those inside `Annotated[...] | None`."""
    if get_origin(hint) is Annotated:
        return [*notes(get_args(hint)[0]), *get_args(hint)[1:]]
    return [note for member in get_args(hint) for note in notes(member)] if type(None) in get_args(hint) else []


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

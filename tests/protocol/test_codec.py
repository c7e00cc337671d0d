"""Messages to bytes and back: nothing is lost, any MessagePack library reads it, and nothing malformed comes through."""

from __future__ import annotations

import random
import subprocess
import sys
from typing import Any, get_args

import msgpack
import msgspec
import numpy as np
import pytest
from every_message import Path, at, contacts, every_message, frame, places, replaced, request, scene, solid
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.codec import decode, encode
from protocol.errors import CablecosimError, MessageError
from protocol.messages import AnyMessage, Error, Hello, Snapshot, Statistics

EVERY = every_message()
PLAIN = [msgpack.unpackb(encode(message)) for message in EVERY]
NAMES = [type(message).__name__ for message in EVERY]


def array(values: Any, dtype: str = "<f8") -> dict[str, Any]:
    """An array as it stands on the wire."""
    data = np.array(values, dtype)
    return {"dtype": dtype, "shape": list(data.shape), "data": data.tobytes()}


def refusal(plain: Any) -> MessageError:
    """The error that a plain message gives."""
    with pytest.raises(MessageError) as caught:
        decode(msgpack.packb(plain))
    return caught.value


def test_there_is_an_example_of_every_message() -> None:
    assert {type(message) for message in EVERY} == set(get_args(AnyMessage))


@pytest.mark.parametrize("message", EVERY, ids=NAMES)
def test_what_is_encoded_is_decoded_to_the_same_bytes_again(message: AnyMessage) -> None:
    again = decode(encode(message))
    assert type(again) is type(message)
    assert encode(again) == encode(message)


@pytest.mark.parametrize("message", EVERY, ids=NAMES)
def test_any_messagepack_library_reads_it_and_what_it_writes_is_read(message: AnyMessage) -> None:
    plain = msgpack.unpackb(encode(message))
    assert plain["type"] == type(message).__name__
    assert encode(decode(msgpack.packb(plain))) == encode(message)


def test_an_array_is_a_map_of_dtype_shape_and_little_endian_bytes() -> None:
    plain = msgpack.unpackb(encode(request()))["problems"][0]["contacts"]
    assert plain["body"] == {"dtype": "<i8", "shape": [3], "data": b"".join(i.to_bytes(8, "little", signed=True) for i in (0, 1, -1))}
    assert np.array_equal(np.frombuffer(plain["extent"]["data"], "<f8").reshape(plain["extent"]["shape"]), contacts().extent)


def test_arrays_come_out_read_only_and_bit_for_bit() -> None:
    odd = np.array([0.1, -0.0, 5e-324, np.nextafter(1.0, 2.0)])
    joints = decode(msgpack.packb({**msgpack.unpackb(encode(frame())), "joints": array(odd)})).joints
    assert joints.tobytes() == odd.tobytes()
    assert not joints.flags.writeable


def test_an_array_in_another_order_is_sent_in_c_order() -> None:
    turned = msgspec.structs.replace(solid(), vertices=np.asfortranarray(solid().vertices + np.arange(3)))
    snapshot = Snapshot(session="", scene=scene(), solids=(turned,), joints=(), steps=0, versions={})
    assert np.array_equal(decode(encode(snapshot)).solids[0].vertices, turned.vertices)


@pytest.mark.parametrize("value", [np.zeros(2, np.float32), np.zeros(2, ">f8"), np.zeros(2, bool), np.array(["a"]), np.array([None]), 1j])
def test_what_has_no_place_in_a_message_is_not_encoded(value: Any) -> None:
    statistics = Statistics(step=0, steps=1, state="running", sentence="running")
    with pytest.raises(TypeError, match="has no place in a message"):
        encode(msgspec.structs.replace(statistics, step=value))


@pytest.mark.thorough
@given(st.text(), st.integers(-(2**63), 2**64 - 1), st.text())
@settings(max_examples=100, derandomize=True, deadline=None)
def test_any_text_and_any_64_bit_number_survives(role: str, version: int, project: str) -> None:
    message = Hello(version=version, role=role, project=project)
    assert decode(encode(message)) == message


SPOILED = [
    # What is wrong, where, by what it is replaced, and the words in which the answer names the place.
    ("dtype", ("problems", 0, "grasps", "s"), array([0, 1], "<i8"), "grasps.s: <i8 of shape (2,) must be <f8 of shape (2,)"),
    ("float for int", ("problems", 0, "contacts", "feature"), array([0.0, 0, 0]), "contacts.feature: <f8"),
    ("length", ("problems", 0, "grasps", "s"), array([0.0]), "grasps.s: <f8 of shape (1,) must be <f8 of shape (2,)"),
    ("columns", ("problems", 0, "grasps", "position"), array([[0.0, 1], [1, 1]]), "grasps.position"),
    ("dimensions", ("problems", 0, "grasps", "s"), array([[0.0, 1]]), "grasps.s"),
    ("no dimension", ("problems", 0, "contacts", "s"), array(0.0), "problems[0].contacts"),
    ("three dimensions", ("problems", 0, "grasps", "s"), array([[[0.0, 1]]]), "problems[0].grasps.s"),
    ("not a number", ("problems", 0, "grasps", "position"), array([[0.0, 0, np.nan], [0, 0, 0]]), "grasps.position"),
    ("infinite", ("problems", 0, "contacts", "point"), array([[0.0, 0, -np.inf]] * 3), "contacts.point"),
    ("huge", ("problems", 0, "grasps", "position"), array([[0.0, 0, 1e5], [0, 0, 0]]), "grasps.position"),
    ("huge force", ("problems", 0, "contacts", "force"), array([[0.0, 0, 1e300]] * 3), "contacts.force"),
    ("not a unit vector", ("problems", 0, "contacts", "normal"), array([[0.0, 0, 1.1]] * 3), "contacts.normal"),
    ("not a unit quaternion", ("problems", 0, "start", "frames"), array([[0.0, 0, 0, 0.9]] * 3), "start.frames"),
    ("edge without direction", ("problems", 0, "contacts", "direction"), array(np.zeros((3, 3))), "contacts.direction"),
    ("no such feature", ("problems", 0, "contacts", "feature"), array([0, 1, 3], "<i8"), "contacts.feature"),
    ("no such friction", ("problems", 0, "contacts", "friction"), array([0, 1, -1], "<i8"), "contacts.friction"),
    ("falling arc length", ("problems", 0, "grasps", "s"), array([1.2, 0.0]), "grasps.s: must grow strictly"),
    ("grasps too close", ("problems", 0, "grasps", "s"), array([0.0, 1e-9]), "grasps.s: two grasps are closer"),
    ("beyond the cable", ("problems", 0, "grasps", "s"), array([0.0, 1.3]), "grasps.s"),
    ("contact beyond the cable", ("problems", 0, "contacts", "s"), array([0.0, 1.0, 1.3]), "contacts.s"),
    ("forces of other grasps", ("problems", 0, "start", "grasp_forces"), array(np.zeros((3, 3))), "start.grasp_forces"),
    ("negative length", ("problems", 0, "cable", "length"), -1.0, "cable.length: -1.0"),
    ("length not a number", ("problems", 0, "cable", "length"), float("nan"), "cable.length: nan"),
    ("bending without twist", ("problems", 0, "cable", "twist"), None, "cable.twist: missing; a cable has both"),
    ("text for a number", ("problems", 0, "cable", "length"), "1.2", "problems[0].cable.length"),
    ("unknown kind", ("problems", 0, "grasps", "hold", 0), "glue", "problems[0].grasps.hold[0]"),
    ("tolerance", ("tolerance",), 0.0, "tolerance: 0.0"),
    ("gravity", ("gravity",), [0.0, 0.0, float("inf")], "gravity"),
    ("too few", ("gravity",), [0.0, 0.0], "gravity"),
    ("text for an array", ("problems", 0, "grasps", "s"), "no array", "problems[0].grasps.s"),
    ("dtype that is none", ("problems", 0, "grasps", "s", "dtype"), "|O", "problems[0].grasps.s"),
    ("big-endian", ("problems", 0, "grasps", "s", "dtype"), ">f8", "problems[0].grasps.s"),
    ("negative size", ("problems", 0, "grasps", "s", "shape"), [-1, -2], "problems[0].grasps.s"),
    ("truth for a size", ("problems", 0, "grasps", "s", "shape"), [True, 2], "problems[0].grasps.s"),
    ("huge size", ("problems", 0, "grasps", "s", "shape"), [2**62, 2**62], "problems[0].grasps.s"),
    ("shape of other size", ("problems", 0, "grasps", "s", "shape"), [3], "problems[0].grasps.s"),
    ("text for bytes", ("problems", 0, "grasps", "s", "data"), "0" * 16, "problems[0].grasps.s"),
]


@pytest.mark.parametrize(("path", "new", "words"), [row[1:] for row in SPOILED], ids=[row[0] for row in SPOILED])
def test_what_is_wrong_is_refused_by_a_sentence_that_names_it(path: Path, new: Any, words: str) -> None:
    assert words in str(refusal(replaced(PLAIN[0], path, new)))


@pytest.mark.parametrize("sizes", [(2, 3), (4, 3), (0, 3), (3, 0), (3, 4)])
@pytest.mark.parametrize("names", [("feature", "direction"), ("direction", "feature"), ("body", "friction"), ("normal", "force")])
def test_columns_of_different_length_are_refused(names: tuple[str, str], sizes: tuple[int, int]) -> None:
    plain = PLAIN[0]
    for name, size in zip(names, sizes, strict=True):
        old = at(plain, ("problems", 0, "contacts", name))
        rows = np.frombuffer(old["data"], old["dtype"]).reshape(old["shape"])
        plain = replaced(plain, ("problems", 0, "contacts", name), array(np.resize(rows, (size, *rows.shape[1:])), old["dtype"]))
    assert refusal(plain).key.startswith("contacts.")


@pytest.mark.parametrize("plain", PLAIN, ids=NAMES)
def test_an_unknown_field_is_refused_at_every_level(plain: Any) -> None:
    for path, value in places(plain):
        if (
            isinstance(value, dict)
            and path != ("versions",)
            and path[-1:] != ("effects",)
            and not {"scene", "cable", "left_out"} & set(path)
        ):
            words = str(refusal(replaced(plain, path, {**value, "surplus": 1})))
            assert "surplus" in words or "must be a map of dtype, shape and data" in words


def test_an_unknown_field_of_a_cable_is_refused() -> None:
    """Else a stiffness with a slip in its name would be left out, and the cable hang as a catenary."""
    assert "bending_stifness" in str(refusal(replaced(PLAIN[0], ("problems", 0, "cable", "bending_stifness"), 0.02)))


OPTIONAL = {
    ("Hello", "project"), ("Welcome", "project"), ("Welcome", "nodes_max"), ("Welcome", "contacts_max"), ("Welcome", "kernels"),
    ("Welcome", "scene_hash"), ("Error", "key"), ("StartRun", "recorders"), ("Statistics", "silent"),
    ("ShapeRequest", "contacts"), ("ShapeRequest", "start"),
    ("ShapeRequest", "loads"), ("ShapeRequest", "model"), ("ShapeRequest", "turns"), ("ShapeRequest", "branch"),
    ("ShapeRequest", "coefficient"), ("ShapeRequest", "speed"), ("ShapeRequest", "table"), ("Frame", "relaxation"),
    ("ShapeRequest", "self_contacts"), ("ShapeRequest", "inclination"), ("ShapeReply", "self_reactions"), ("Frame", "self_reactions"),
    ("ShapeReply", "rubbed"), ("Frame", "rubbed"), ("ShapeRequest", "budget"), ("ShapeRequest", "extrapolate"), ("ShapeRequest", "margin"),
    ("ShapeRequest", "effects"), ("ShapeReply", "predicted"), ("Frame", "predicted"),
    ("ShapeRequest", "crossings"), ("ShapeReply", "crossings"), ("Frame", "crossing"), ("Frame", "coupling"),
    ("Frame", "audits"), ("Statistics", "wants_audits"),
}  # fmt: skip
"""Fields that may be left out, and get the value that docs/protocol.md gives; those of cable and scene aside."""


@pytest.mark.parametrize("plain", PLAIN, ids=NAMES)
def test_a_missing_field_is_refused_unless_it_has_a_default(plain: Any) -> None:
    for path, _ in places(plain):
        if not path or not isinstance(path[-1], str) or {"scene", "cable", "versions", "left_out", "effects"} & set(path[:-1]):
            continue
        parent = at(plain, path[:-1])
        rest = msgpack.packb(replaced(plain, path[:-1], {key: item for key, item in parent.items() if key != path[-1]}))
        if (plain["type"], path[-1]) in OPTIONAL:
            decode(rest)
        else:
            with pytest.raises(MessageError):
                decode(rest)


@pytest.mark.parametrize("plain", [None, 1, "Stop", [], {}, {"type": "Nothing"}, {"type": 1}, {"type": "Stop", 1: 2}, [{"type": "Stop"}]])
def test_what_is_no_message_is_refused(plain: Any) -> None:
    assert str(refusal(plain)).startswith("not a message of this protocol")


@pytest.mark.thorough
def test_every_value_of_every_message_may_be_replaced_by_anything_and_only_our_errors_come_of_it() -> None:
    """Each value in turn by each of a few strange ones: some ten thousand messages."""
    strange = [
        None,
        True,
        -1,
        2**64 - 1,
        1.5,
        float("nan"),
        float("inf"),
        1e308,
        "",
        "x",
        b"",
        [],
        [[]],
        {},
        array([]),
        array(0.0),
        array([0, 1], "<i8"),
    ]
    refused = [is_refused(msgpack.packb(replaced(plain, path, new))) for plain in PLAIN for path, _ in places(plain) for new in strange]
    assert len(refused) > 10_000
    assert 0.85 < np.mean(refused) < 0.95  # measured 9216 of 10098


def test_any_array_may_have_any_other_shape_and_only_our_errors_come_of_it() -> None:
    shapes: list[list[int]] = [[], [0], [1], [2], [5], [0, 0], [0, 3], [1, 3], [2, 2], [3, 4], [4, 1], [7, 3]]
    arrays = [(plain, path) for plain in PLAIN for path, value in places(plain) if isinstance(value, dict) and "dtype" in value]
    new = [array(np.ones(shape, dtype), dtype) for shape in shapes for dtype in ("<f8", "<i8")]
    refused = [is_refused(msgpack.packb(replaced(plain, path, value))) for plain, path in arrays for value in new]
    assert len(refused) == 24 * len(arrays)
    assert 0.95 < np.mean(refused) < 0.995  # measured 1089 of 1104


@pytest.mark.parametrize("message", EVERY, ids=NAMES)
def test_a_message_cut_off_anywhere_is_refused(message: AnyMessage) -> None:
    data = encode(message)
    for end in range(len(data)):
        with pytest.raises(MessageError):
            decode(data[:end])


@pytest.mark.parametrize("message", EVERY, ids=NAMES)
def test_a_message_with_something_behind_it_is_refused(message: AnyMessage) -> None:
    with pytest.raises(MessageError):
        decode(encode(message) + b"\xc0")


def test_five_thousand_mutations_give_a_message_or_one_of_our_errors() -> None:
    chance = random.Random(20240601)
    encoded = [encode(message) for message in EVERY]
    refused = []
    for _ in range(5000):
        data = bytearray(chance.choice(encoded))
        for _ in range(chance.choice((1, 1, 2, 8))):
            place = chance.randrange(len(data))
            match chance.randrange(4):
                case 0:
                    data[place] = chance.randrange(256)
                case 1:
                    data[place] ^= 1 << chance.randrange(8)
                case 2:
                    data[place:place] = chance.randbytes(chance.randrange(1, 9))
                case _:
                    del data[place : place + chance.randrange(1, 9)]
            data = data or bytearray(1)
        refused.append(is_refused(bytes(data)))
    assert 0.9 < np.mean(refused) < 0.97  # measured 4709 of 5000


@pytest.mark.parametrize("nested", [b"\x91", b"\x81\xa1x"], ids=["arrays", "maps"])
@pytest.mark.parametrize("head", [b"", b"\x82\xa4type\xa5Frame\xa6joints", b"\x82\xa4type\xa8Snapshot\xa5scene"])
def test_a_hundred_thousand_levels_are_refused(nested: bytes, head: bytes) -> None:
    with pytest.raises(MessageError):
        decode(head + nested * 100_000 + b"\xc0")


def test_a_length_that_is_only_announced_allocates_nothing() -> None:
    for announced in (b"\xdd\xff\xff\xff\xff", b"\xdf\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff", b"\xdb\xff\xff\xff\xff"):
        for head in (b"", b"\x82\xa4type\xa5Frame\xa6joints", b"\x82\xa4type\xacShapeRequest\xa8problems"):
            with pytest.raises(MessageError):
                decode(head + announced)


MEMORY = """
import resource, sys
from protocol.codec import decode
from protocol.errors import MessageError
many = b"\\xdd" + (4_000_000).to_bytes(4, "big") + b"\\x80" * 4_000_000
data = bytes.fromhex(sys.argv[1]) + many
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    decode(data)
except MessageError:
    print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


@pytest.mark.parametrize(
    ("head", "most"),
    [
        (b"", 16),
        (b"\x82\xa4type\xacShapeRequest\xa8problems", 16),
        (b"\x82\xa4type\xa4Stop\xa6behind", 16),
        (b"\x82\xa4type\xa5Frame\xa6joints", 16),
        (b"\x82\xa4type\xa5Frame\xaacollisions", 16),
    ],
    ids=["alone", "in a list of messages", "in an unknown field", "in place of an array", "in a list of pairs"],
)
def test_four_million_empty_maps_cost_no_more_than_this(head: bytes, most: int) -> None:
    """`most` in MiB."""
    run = subprocess.run([sys.executable, "-c", MEMORY, head.hex()], capture_output=True, text=True, check=True, timeout=60)
    assert int(run.stdout) < most


def test_the_key_of_an_error_is_the_field() -> None:
    assert refusal(replaced(PLAIN[0], ("tolerance",), -1.0)).key == "tolerance"
    assert refusal(replaced(PLAIN[0], ("problems", 0, "grasps", "s"), array([0.0]))).key == "grasps.s"
    assert refusal(replaced(PLAIN[0], ("problems", 0, "cable", "length"), "long")).key == "problems[0].cable.length"
    assert refusal(replaced(PLAIN[0], ("problems", 0, "cable", "bendng"), 1.0)).key == "problems[0].cable.bendng"


def test_an_error_may_carry_any_sentence() -> None:
    message = Error(code="message", sentence="\x00 \u2603 \U0001f600", key="")
    assert decode(encode(message)) == message


def is_refused(data: bytes) -> bool:
    """Whether decoding gives one of our own errors; any other passes."""
    try:
        decode(data)
    except CablecosimError:
        return True
    return False

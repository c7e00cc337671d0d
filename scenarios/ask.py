"""Asks a shape server of one's own, without any socket, for the shape of one posture."""

from __future__ import annotations

import subprocess
from typing import Any, Final

import numpy as np

from protocol.codec import decode, encode
from protocol.errors import CablecosimError, MessageError, PeerLostError
from protocol.kinds import Outcome
from protocol.messages import Error, Shape, ShapeReply

from .children import REFUSED, command, environment, refusal, signal_name
from .posture import Posture

LIMIT: Final = 300.0  # s for one shape beyond its budget, with every kernel compiled for the first time


def ask(posture: Posture) -> Shape:
    """The shape of a cable in a posture; its outcome says whether it is one.

    Raises:
        PeerLostError: If the shape server dies or takes `LIMIT` seconds more than the posture's budget.
        CablecosimError: If it refuses the request.
    """
    limit = LIMIT + (posture.budget or 0.0)
    try:
        done = subprocess.run(
            command("shape_server", ("--posture", "-")),
            input=encode(posture.request()),
            capture_output=True,
            timeout=limit,
            env=environment(),
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise PeerLostError(
            f"shape_server took more than {limit:g} s for one shape; ask for a larger tolerance", key="shape_server"
        ) from error
    words = "\n".join(done.stderr.decode(errors="replace").rstrip().splitlines()[-8:])
    if done.returncode == REFUSED and words:
        raise CablecosimError(refusal("shape_server", words), key="shape_server")
    try:
        reply = decode(done.stdout)
    except MessageError as error:
        end = f"was killed by signal {signal_name(-done.returncode)}" if done.returncode < 0 else f"ended with exit code {done.returncode}"
        raise PeerLostError(f"shape_server {end} without an answer; its last lines were:\n{words}", key="shape_server") from error
    if isinstance(reply, Error):
        raise CablecosimError(reply.sentence, key=reply.key)
    if not isinstance(reply, ShapeReply) or len(reply.shapes) != 1:
        raise PeerLostError(f"shape_server answered with a {type(reply).__name__} and not with one shape", key="shape_server")
    return reply.shapes[0]


def as_json(posture: Posture, shape: Shape) -> dict[str, Any]:
    """A shape in plain values, under the names of the message, in SI units."""
    held = sorted(grasp.at for grasp in posture.grasps)
    return {"title": posture.title, "grasp_s": held, **_plain(shape)}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, Outcome):
        return value.value
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if hasattr(value, "__struct_fields__"):
        return {name: _plain(getattr(value, name)) for name in value.__struct_fields__}
    return value

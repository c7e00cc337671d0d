"""How long this project takes to follow moving clamps, against the programs that a user would pick instead, at equal error.

    pip install '.[bench]'
    OPENBLAS_NUM_THREADS=1 taskset -c 1 python -m pytest -m bench tests/bench -s

prints, for 200 small motions of a rod in the plane and in space, one row for every program and setting with its CPU time per motion and
its largest error, and below them how many times longer each peer takes at equal error. Of every program only those settings count that no
other one of its own beats in both; between them one goes along straight lines of log-log axes. The least ratio must reach ten, at
whatever error the peer does best. Errors above 1 % of the length are of no use, errors below 1e-7 of no
interest: neither counts. A peer that is not installed is left out; the reason says how to install it.

Problems, references, how time and error are taken, and how each peer was set up and why so, stand in `shape_server/accuracy/peers`.
All programs run on one thread, compiled, warm, and at rest where the motions start.
"""

from __future__ import annotations

import sys
from functools import cache
from types import ModuleType

import numpy as np
import pytest

from shape_server.accuracy.peers import ours, peer_cabledyn, peer_moorpy, peer_mujoco, peer_pyelastica, peer_scipy
from shape_server.accuracy.peers.collocation import Solved
from shape_server.accuracy.peers.installed import is_installed
from shape_server.accuracy.peers.motions import Hanging, planar_motions, spatial_motions
from shape_server.accuracy.peers.references import catenary, references
from shape_server.accuracy.peers.timing import Row, distance, follow, least_ratio, milliseconds, table, time_for

pytestmark = [pytest.mark.bench, pytest.mark.timeout(900), pytest.mark.filterwarnings("default")]

FASTER = 10  # times, at equal error; measured 12.6 (MuJoCo, planar, at 1e-2 of the length) and more
FASTER_HANGING = 100  # measured 120 to 127
COARSEST, FINEST = 1e-2, 1e-7  # errors over the length that are compared
PEERS = {peer.NAME: peer for peer in (peer_scipy, peer_mujoco, peer_cabledyn, peer_pyelastica)}
DECADES = 10.0 ** np.arange(-2, -8, -1)
SEQUENCES = {
    "planar, EI = 3e-3": planar_motions(3e-3),
    "planar, EI = 1e-2": planar_motions(1e-2),
    "spatial, EI = 3e-3": spatial_motions(3e-3),
    "spatial, EI = 1e-2": spatial_motions(1e-2),
}
each_sequence = pytest.mark.parametrize("sequence", SEQUENCES)


@cache
def exact(sequence: str) -> dict[int, Solved]:
    return references(SEQUENCES[sequence])


@cache
def rows(program: ModuleType, sequence: str) -> tuple[Row, ...]:
    """All settings of a program along a sequence."""
    motions, known = SEQUENCES[sequence], exact(sequence)
    numbers = list(range(1, len(motions.position))) if program.REMEMBERS else sorted(known)[1:]
    return tuple(
        follow(program.NAME, setting, program.prepare(motions, known[0], setting), motions, known, numbers=numbers)
        for setting in program.sweep(motions)
    )


def require(peer: ModuleType) -> None:
    if not is_installed(peer):
        pytest.skip(peer.INSTALL)


def show(text: str) -> None:
    sys.stdout.write(f"\n{text}\n")


@each_sequence
def test_every_program_has_its_rows_in_the_table(sequence: str) -> None:
    installed = [peer for peer in PEERS.values() if is_installed(peer)]
    everything = [row for program in (ours, *installed) for row in rows(program, sequence)]
    show(f"{len(SEQUENCES[sequence].position) - 1} motions, {sequence} N m^2\n{table(everything)}")
    for program in (ours, *installed):
        assert any(row.error < COARSEST for row in rows(program, sequence)), program.NAME


@each_sequence
@pytest.mark.parametrize("name", PEERS)
def test_at_equal_error_a_peer_takes_many_times_as_long(name: str, sequence: str) -> None:
    peer = PEERS[name]
    require(peer)
    mine, theirs = rows(ours, sequence), rows(peer, sequence)
    ratio, error = least_ratio(mine, theirs, coarsest=COARSEST, finest=FINEST)
    decades = ", ".join(f"{time_for(theirs, at) / time_for(mine, at):.0f} at {at:.0e}" for at in DECADES if time_for(theirs, at) < np.inf)
    show(f"{sequence}: {name} takes {decades} times as long; at least {ratio:.1f} times, at {error:.1e}")
    assert ratio >= FASTER


def test_a_hanging_cable_of_100_nodes_takes_moorpy_many_times_as_long() -> None:
    require(peer_moorpy)
    hanging = Hanging()
    s, load, known = hanging.s(), np.array([0.0, 0.0, -hanging.weight]), catenary(hanging)
    spans = hanging.span + 1e-3 * np.sin(np.arange(1000))  # m, so that no call repeats another; the first is the span
    ends = np.outer(spans, [1.0, 0.0, 0.0])
    mine = milliseconds(lambda number: ours.hang(hanging, ends[number], load, s))
    theirs = milliseconds(lambda number: peer_moorpy.hang(hanging, spans[number]))
    shapes = ours.hang(hanging, ends[0], load, s), peer_moorpy.hang(hanging, spans[0])
    errors = [distance(nodes, known) / hanging.length for nodes in shapes]
    show(table([Row(ours.NAME, "closed form", mine, errors[0]), Row(peer_moorpy.NAME, "tolerance 1e-6 m", theirs, errors[1])]))
    assert errors[0] <= errors[1]
    assert theirs >= FASTER_HANGING * mine

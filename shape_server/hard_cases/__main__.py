"""The shape server's hard cases, by numbers from standard input (`protocol.hard_case.serve`); `cablecosim hardcases` asks for them."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from types import ModuleType

from protocol.hard_case import serve

from .. import blas
from ..paths import CHOICES, Paths, is_compiled
from . import peers
from .catalogue import catalogue, warm_up


def main() -> None:
    """Answer until nobody asks any more."""
    blas.use_one_thread()
    parser = argparse.ArgumentParser(prog="python -m shape_server.hard_cases", description="Solves hard cases by their numbers.")
    parser.add_argument("--kernels", choices=CHOICES, default="auto", help="auto: compiled if they are ready (default)")
    parser.add_argument("--peer", metavar="NAME", help="ask another program for them")
    parser.add_argument("--peers", action="store_true", help="name the other programs that are installed, and end")
    given = parser.parse_args()
    if given.peers:
        sys.stdout.write(json.dumps(peers.names()) + "\n")
        return
    asked = given.kernels
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asks decides when to end

    def prepare() -> tuple[ModuleType, str]:
        kernels = asked if asked != "auto" else "compiled" if is_compiled() else "numpy"
        path = Paths(kernels).current
        warm_up(path)
        return path, kernels

    def prepare_peer() -> tuple[tuple[ModuleType, ModuleType], str]:
        path, kernels = prepare()
        peers.warm_up(peers.PEERS[given.peer])
        return (peers.PEERS[given.peer], path), kernels

    if given.peer:
        serve(peers.cases_of(catalogue()), prepare_peer)
    else:
        serve(catalogue(), prepare)


if __name__ == "__main__":
    main()

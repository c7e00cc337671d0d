"""What the programs raise for a wrong request; a hard problem is an `Outcome`, never an exception.

CablecosimError
├── SceneError        the scene, or a posture file, says something impossible; names the key
├── MessageError      bytes from a peer that are no message of ours, or out of range
├── VersionError      the peer speaks another version of the protocol
├── PeerLostError     the peer did not answer within the written time-out, after every retry
├── AddressError      an address that is taken, or that others could reach
└── RecordingError    a recording that cannot be read at all

Each carries one sentence that names the thing, its value and what would be right.
"""

from __future__ import annotations


class CablecosimError(Exception):
    """Anything this project raises on purpose; the text is one sentence for the user.

    Attributes:
        key: Dotted key, name or address that the sentence is about; empty when there is none.
    """

    def __init__(self, sentence: str, *, key: str = "") -> None:
        super().__init__(sentence)
        self.key = key


class SceneError(CablecosimError):
    """A scene or posture that cannot be simulated as written."""


class MessageError(CablecosimError):
    """Bytes that do not decode to a message, or a message with a value out of range."""


class VersionError(CablecosimError):
    """Two programs that speak different versions of the protocol."""


class PeerLostError(CablecosimError):
    """A peer that stayed silent through every retry."""


class AddressError(CablecosimError):
    """An address that cannot be used."""


class RecordingError(CablecosimError):
    """A recording without a readable beginning."""

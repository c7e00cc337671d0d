"""Questions to the environment, from a launcher that looks after all programs while it waits for the answers."""

from __future__ import annotations

import time
from typing import Final

from protocol.channel import Client
from protocol.errors import PeerLostError, SceneError
from protocol.keys import Keys
from protocol.messages import AnyMessage, Done, Error, Message, StartRun, Statistics, StatisticsRequest, Stop

from .keeper import Keeper

ANSWER_LIMIT: Final = 60.0  # s for the answer to a command; and for a program to speak for the first time before it counts as silent
STOP_LIMIT: Final = 10.0  # s for the environment to end a run that is stopped
START_LIMIT: Final = 300.0  # s until the environment is ready, with every kernel compiled for the first time
POLL: Final = 0.1  # s between looks at the programs
NAME: Final = "env_server"


class Remote:
    """The environment of a run, which may be another program than a moment ago."""

    def __init__(self, address: str, keeper: Keeper, keys: Keys | None) -> None:
        self._address, self._keeper, self._keys = address, keeper, keys
        self._client = Client(address, "launcher", keys)
        self._has_spoken = False  # the present program
        self._has_started = False  # the run, in the present program

    def greet(self, end: float) -> None:
        """Wait until the environment speaks, at most until a time."""
        while not self._has_spoken:
            try:
                self._client.greet(1.0)
            except PeerLostError:
                if self._look() or time.monotonic() <= end:
                    continue
                raise
            self._has_spoken = True

    def state(self) -> Statistics | None:
        """How far the run is; None if the environment has ended well by itself."""
        try:
            return self.statistics()
        except PeerLostError:
            if self._keeper.child(NAME).code == 0:
                return None
            raise

    def statistics(self) -> Statistics:
        """How far the run is.

        Raises:
            SceneError: If the environment refuses to say.
            PeerLostError: If it has ended.
        """
        answer = self._ask(StatisticsRequest(), START_LIMIT)
        assert isinstance(answer, Statistics)
        return answer

    def start(self) -> None:
        """Start the run, once in every program that has it."""
        if not self._has_started:
            self._has_started = True  # unless another program takes over before it has heard
            self._ask(StartRun(recorders=1), ANSWER_LIMIT)

    def stop(self) -> None:
        """End the run after the present step."""
        self._ask(Stop(), STOP_LIMIT)

    def say_stop(self) -> None:
        """Ask for the end of the run, without waiting."""
        self._client.send(Stop())

    def close(self) -> None:
        """Hang up."""
        self._client.close()

    def _ask(self, message: Message, limit: float) -> AnyMessage:
        """The answer to a message, of whichever program there is; a refusal is raised."""
        wanted = Statistics if isinstance(message, StatisticsRequest) else Done
        self._client.send(message)
        asked = sent = time.monotonic()
        end = asked + limit
        while time.monotonic() < end:
            if self._look() or self._is_silent(time.monotonic() - asked):
                asked = sent = time.monotonic()
                if isinstance(message, StartRun):  # not before the new program is ready
                    return Done()
                self._client.send(message)
            elif isinstance(message, StatisticsRequest) and time.monotonic() - sent > self._keeper.silence / 3:
                sent = time.monotonic()  # a question may be lost; it changes nothing to put it twice
                self._client.send(message)
            answer = self._client.receive(POLL)
            if isinstance(answer, Error):
                raise SceneError(answer.sentence, key=answer.key)
            if isinstance(answer, wanted):
                self._has_spoken = True
                return answer
        raise PeerLostError(f"{NAME} gave no answer to a {type(message).__name__} within {limit:g} s", key=NAME)

    def _is_silent(self, seconds: float) -> bool:
        """Whether a program that does not answer has been replaced."""
        limit = self._keeper.silence if self._has_spoken else max(ANSWER_LIMIT, self._keeper.silence)
        if seconds < limit or not self._keeper.replace(NAME, f"gave no sign of life for {limit:g} s"):
            return False
        self._turn_to_next()
        return True

    def _look(self) -> bool:
        """Look after the programs; whether the environment is another one now."""
        is_another = NAME in self._keeper.mend()
        if not is_another and self._keeper.child(NAME).code is not None:
            is_another = NAME in self._keeper.mend()  # it may have ended since it was looked at
        if is_another:
            self._turn_to_next()
        elif self._keeper.child(NAME).code is not None:
            raise PeerLostError(self._keeper.child(NAME).obituary(), key=NAME)
        return is_another

    def _turn_to_next(self) -> None:
        # What was said to the one before is not for the next one, and its late answers are for nobody.
        self._client.close()
        self._client = Client(self._address, "launcher", self._keys)
        self._has_spoken = self._has_started = False

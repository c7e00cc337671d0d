"""Looks: follows a run, records it, draws pictures of it and writes a page that replays it; needs no display."""

from .client import watch as watch
from .picture import draw as draw
from .redraw import redraw as redraw
from .replay import write_replay as write_replay

"""Turns made by hand."""

import numpy as np

from models.interpret.turns import Turns


def turns(count: int, **columns: object) -> Turns:
    """A table of `count` turns in one episode, all sent; columns override."""
    given = {
        "episode": np.zeros(count, np.int64),
        "sent": np.ones(count, bool),
        "token": np.zeros(count, np.int32),
        "cell": np.zeros(count, np.int32),
        "action": np.zeros(count, np.int32),
        "route": np.zeros(count, np.int32),
        "position": np.zeros(count, np.int32),
        "entered": np.zeros(count, bool),
    }
    return Turns(**{name: np.asarray(columns.get(name, value), value.dtype) for name, value in given.items()})

"""What only traffic can tell: rates along the route, gas or brake, and lanes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from models.interpret.along import Along, along
from models.interpret.deeds import Deeds, deeds
from models.interpret.lanes import Lanes, lanes
from models.interpret.nulls import in_use
from models.interpret.shared import Shared, groups, shared

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from models.envs.traffic_junction import TrafficJunction
    from models.interpret.turns import Turns


class Common(NamedTuple):
    """Tokens that are said from more than one place of a kind, a tenth of their use or more from each."""

    tokens: int
    of: int
    """Tokens in use, among which they are counted."""
    messages: float
    """Their share of all messages."""


@dataclass(frozen=True, eq=False)
class Traffic:
    """Everything that needs roads; K tokens, G lanes.

    Attributes:
        along: message rate along the route.
        deeds: gas or brake.
        lanes: the lanes of the world.
        by_lane: (K, G) messages of each token from each lane.
        lane: what a token tells about the lane on which its speaker drives.
        arrival: ... about the entrance by which it came.
        route: ... about its route.
        common_lanes: tokens said from more than one lane.
        common_arrivals: tokens said by cars from more than one entrance.
    """

    along: Along
    deeds: Deeds
    lanes: Lanes
    by_lane: NDArray[np.int64]
    lane: Shared
    arrival: Shared
    route: Shared
    common_lanes: Common
    common_arrivals: Common


def traffic(env: TrafficJunction, turns: Turns, tokens: int, seed: int) -> Traffic:
    """Measure turns in traffic."""
    said = turns.take(turns.sent)
    ways = lanes(env)
    lane = ways.of[said.route, said.position]
    arrival = said.route // np.int32(env.routes_per_entrance)
    by_lane = np.zeros((tokens, len(ways.names)), np.int64)
    np.add.at(by_lane, (said.token, lane), 1)
    return Traffic(
        along=along(turns, seed),
        deeds=deeds(said, tokens),
        lanes=ways,
        by_lane=by_lane,
        lane=shared(said.token, lane),
        arrival=shared(said.token, arrival),
        route=shared(said.token, said.route),
        common_lanes=_common(said, lane, tokens),
        common_arrivals=_common(said, arrival, tokens),
    )


def _common(said: Turns, group: NDArray[np.int32] | NDArray[np.int64], tokens: int) -> Common:
    uses = np.bincount(said.token, minlength=tokens)
    used = in_use(uses)
    many = used & (groups(said.token, group, tokens) > 1)
    return Common(int(many.sum()), int(used.sum()), float(uses[many].sum() / max(uses.sum(), 1)))

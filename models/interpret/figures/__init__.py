"""The pictures of a language, each one chart definition that is written as SVG (or PNG, to look at)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from models.envs.traffic_junction import TrafficJunction
from models.interpret.figures.ground import ground
from models.interpret.figures.heatmaps import heatmaps
from models.interpret.figures.overlay import calibration_plot
from models.interpret.figures.planes import by_gas, by_lane, prototypes
from models.interpret.figures.routes import gas_by_token, rate_along_route
from models.interpret.figures.scatter import distance_scatter
from models.interpret.figures.style import Chart, beside, write
from models.interpret.figures.tokens import null_threshold, null_tokens, token_use

if TYPE_CHECKING:
    from models.envs.api import Environment
    from models.interpret.summary import Meaning


def figures(env: Environment[Any], meaning: Meaning) -> dict[str, Chart]:
    """Return every figure of a language by its file name (without suffix)."""
    lexicon, traffic = meaning.lexicon, meaning.traffic
    charts: dict[str, Chart] = {
        "prototypes": prototypes(lexicon),
        "heatmaps": heatmaps(lexicon, ground(env)),
        "distances": distance_scatter(meaning.distances),
        "token-use": token_use(lexicon),
        "null-tokens": null_tokens(lexicon),
        "null-threshold": null_threshold(lexicon),
    }
    if traffic is not None:
        assert isinstance(env, TrafficJunction)
        charts["lanes-and-actions"] = beside(by_lane(lexicon, traffic), by_gas(lexicon, traffic.deeds))
        charts["rate-along-route"] = rate_along_route(env, {"this agent": traffic.along})
        charts["gas-by-token"] = gas_by_token(traffic.deeds)
    if meaning.calibration is not None:
        charts["calibration"] = calibration_plot(meaning.calibration)
    return charts


__all__ = [
    "Chart",
    "beside",
    "by_gas",
    "by_lane",
    "calibration_plot",
    "distance_scatter",
    "figures",
    "gas_by_token",
    "ground",
    "heatmaps",
    "null_threshold",
    "null_tokens",
    "prototypes",
    "rate_along_route",
    "token_use",
    "write",
]

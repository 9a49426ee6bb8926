"""Do stored weights fit? By name and shape, the same words for every architecture."""

from collections.abc import Mapping, Sequence

from torch import Tensor


def require(expected: Mapping[str, Sequence[int]], weights: Mapping[str, Tensor]) -> None:
    """Compare weights with the shapes that an architecture has.

    Raises:
        ValueError: a weight is missing, unknown or of another shape; the first one is named.
    """
    if odd := sorted(set(expected) ^ set(weights)):
        raise ValueError(f"weights do not fit the architecture: {odd[0]} is missing or unknown")
    for name, shape in expected.items():
        if tuple(weights[name].shape) != tuple(shape):
            raise ValueError(f"{name} has shape {tuple(weights[name].shape)}, not {tuple(shape)}")

"""The networks of which a bundle may hold weights, by the name that its manifest gives.

To add one: a module with a class that has `from_weights(architecture, weights)` and `weights()` and fulfils
`Policy` (`models.policies.api`), and a line here. A name keeps its meaning for ever: stored trials name
bundles, and bundles name it.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

from torch import Tensor

from models.policies.api import Policy
from models.policies.plain import PlainPolicy
from models.policies.recurrent import Architecture, RecurrentPolicy

RECURRENT = "recurrent"
"""What `hatlab train` makes; the manifests that name none mean it."""


class StoredPolicy(Policy, Protocol):
    """A policy whose weights can be written down."""

    @property
    def architecture(self) -> Architecture:
        """Every size that the weights depend on."""
        ...

    def weights(self) -> dict[str, Tensor]:
        """Name to tensor, contiguous float32."""
        ...


Build = Callable[[Architecture, Mapping[str, Tensor]], StoredPolicy]
"""Raises ValueError if a weight is missing, unknown or of another shape, or the sizes cannot be."""

ARCHITECTURES: dict[str, Build] = {RECURRENT: RecurrentPolicy.from_weights, "gru": PlainPolicy.from_weights}

"""Where training computes: `cpu`, or an accelerator that torch knows.

Only the network moves: worlds, draws and checks stay on the CPU.
"""

import re

import torch


class DeviceError(Exception):
    """There is no such device. One line: its name and what there is."""


def find(name: str) -> torch.device:
    """The device of this name, once it has been shown to compute.

    Raises:
        DeviceError: torch does not know it, or this machine has none.
    """
    try:
        device = torch.device(name)
        if torch.ones(1, device=device).add(1).item() == 2:
            return device
        reason = "it computes 1 + 1 wrongly"
    except (RuntimeError, AssertionError, ImportError) as error:
        reason = re.split(r"\. |\n", str(error))[0]
    raise DeviceError(f"device {name!r} cannot be used here ({reason}); cpu always can")

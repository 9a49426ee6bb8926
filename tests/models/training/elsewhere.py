"""An accelerator for machines without one: tensors that compute on the CPU, but meet no tensor of the CPU.

Real accelerators refuse an operation on tensors from two places. So does this one, which is a tensor class
whose device is called `meta` and a mode that watches every call: `.to`, `.cpu` and `device=` are the only
ways across, numpy cannot read it, and numbers (tensors without dimensions) and indices may come from the CPU.
"""

from typing import Any

import torch
from torch.overrides import TorchFunctionMode

ELSEWHERE, HERE = torch.device("meta"), torch.device("cpu")
CARRY = {
    torch.Tensor.to,
    torch.Tensor.cpu,
    torch.Tensor.copy_,
    torch.Tensor.__getitem__,
    torch._has_compatible_shallow_copy_type,  # asked by a module that moves
}
"""May take tensors from both sides: they carry them over, or index."""


class Distant(torch.Tensor):
    """A tensor on the accelerator."""

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        copied = self.detach().clone()
        return torch.nn.Parameter(copied) if isinstance(self, torch.nn.Parameter) else copied


class MixedError(RuntimeError):
    """Tensors of two places met, or numpy looked at one that is far away."""


class Accelerator(TorchFunctionMode):
    """While it is entered, `meta` is a device that computes."""

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = dict(kwargs or {})
        tensors = [value for value in _flat((args, list(kwargs.values()))) if isinstance(value, torch.Tensor)]
        distant = [isinstance(value, Distant) for value in tensors]
        if func == torch.Tensor.device.__get__:
            return ELSEWHERE if distant[0] else HERE
        if func == torch.Tensor.grad.__get__:  # autograd gives it as a plain tensor
            grad = func(*args)
            return grad.as_subclass(Distant) if distant[0] and grad is not None else grad
        if func is torch.Tensor.numpy and any(distant):
            raise MixedError("numpy cannot read an accelerator")
        near = [value for value, far in zip(tensors, distant, strict=True) if not far and value.dim()]
        if any(distant) and near and func not in CARRY:
            raise MixedError(f"{func}: tensors of two devices")
        if func is torch.Tensor.cpu:
            return args[0].as_subclass(torch.Tensor)
        targets = [value for value in (*args[1:], *kwargs.values()) if isinstance(value, torch.device)]
        if not targets:
            return func(*args, **kwargs)
        args, kwargs = tuple(_here(value) for value in args), {k: _here(v) for k, v in kwargs.items()}
        kind = Distant if targets[0] == ELSEWHERE else torch.Tensor
        return func(*args, **kwargs).as_subclass(kind)


def _here(value: Any) -> Any:
    return HERE if value == ELSEWHERE and isinstance(value, torch.device) else value


def _flat(value: Any) -> list[Any]:
    if isinstance(value, list | tuple):
        return [one for part in value for one in _flat(part)]
    return [value]

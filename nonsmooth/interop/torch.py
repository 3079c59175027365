"""Runs as functions of PyTorch that can be differentiated: their gradients are those of :func:`nonsmooth.vjp`."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model import FilippovSystem
from ..result_tables import library
from .runs import Runs, parameters_of

if TYPE_CHECKING:
    import torch

__all__ = ["ensemble", "simulate"]


def simulate(
    system: FilippovSystem,
    x0: Any,
    t_end: float,
    parameters: Any = None,
    *,
    t_eval: Any = None,
    **options: Any,
) -> torch.Tensor:
    """Final state of a run, or its states at given times.

    Parameters
    ----------
    system, t_end, parameters, t_eval, **options
        As for :func:`nonsmooth.interop.jax.simulate`, with tensors.
    x0 : torch.Tensor (n,)
        The start.

    Returns
    -------
    torch.Tensor (n,) or (K, n), float64
        The state at the end, or those at ``t_eval``.

    Raises
    ------
    DegenerateError
        The run ends with a status without an end, as NON_UNIQUE; or, in gradients, an event is grazed.
    """
    return _called(Runs.of(system, t_end, t_eval, False, options), x0, parameters)


def ensemble(
    system: FilippovSystem,
    x0: Any,
    t_end: float,
    parameters: Any = None,
    *,
    t_eval: Any = None,
    **options: Any,
) -> torch.Tensor:
    """Final states of many runs, or their states at given times.

    Parameters
    ----------
    system, t_end, parameters, t_eval, **options
        As for :func:`nonsmooth.interop.jax.ensemble`, with tensors.
    x0 : torch.Tensor (..., n)
        Starts.

    Returns
    -------
    torch.Tensor (..., n) or (..., K, n), float64
        NaN for runs that end with a status without an end, as NON_UNIQUE; so are their gradients.
    """
    return _called(Runs.of(system, t_end, t_eval, True, options), x0, parameters)


@cache
def _run(torch: Any) -> Any:
    """A function of PyTorch: values of runs, and rows pulled back through them."""

    class Run(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, runs: Runs, x0: Any, p: Any) -> Any:
            ctx.runs = runs
            ctx.save_for_backward(x0, p)
            return torch.as_tensor(np.array(runs.values(*map(_array, (x0, p)))), device=x0.device)

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx: Any, rows: Any) -> Any:
            x0, p = ctx.saved_tensors
            pulled = ctx.runs.pulled(*map(_array, (x0, p, rows)))
            return None, *(torch.as_tensor(part, device=x0.device) for part in pulled)

    return Run


def _called(runs: Runs, x0: Any, parameters: Any) -> Any:
    torch = library("torch", "interop.torch", "torch")
    tensor = lambda value: torch.as_tensor(value, dtype=torch.float64)
    x0 = tensor(x0)
    stack = lambda parts: torch.stack(torch.broadcast_tensors(*parts), -1) if parts else tensor([])
    p = parameters_of(runs.system, parameters, stack, tensor)
    runs.require_shapes(x0.shape, p.shape)
    batch = torch.broadcast_shapes(x0.shape[:-1], p.shape[:-1])
    return _run(torch).apply(runs, *(v.expand(*batch, v.shape[-1]) for v in (x0, p)))


def _array(value: Any) -> Any:
    return value.detach().cpu().numpy()

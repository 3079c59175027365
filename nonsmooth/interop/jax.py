"""Runs as functions of JAX that can be differentiated: their gradients are those of :func:`nonsmooth.vjp`.

They work under ``jax.jit``, ``jax.grad`` and ``jax.vmap``; a run itself is computed on the processor. Set
``jax.config.update("jax_enable_x64", True)``: without it JAX rounds to 32 bits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..model import FilippovSystem
from ..result_tables import library
from .runs import Runs, parameters_of

if TYPE_CHECKING:
    import jax

__all__ = ["ensemble", "simulate"]


def simulate(
    system: FilippovSystem,
    x0: Any,
    t_end: float,
    parameters: Any = None,
    *,
    t_eval: Any = None,
    **options: Any,
) -> jax.Array:
    """Final state of a run, or its states at given times.

    Parameters
    ----------
    system : FilippovSystem
        As for :func:`nonsmooth.simulate`.
    x0 : jax.Array (n,)
        The start.
    t_end : float
        Time at which the run ends; it is a constant.
    parameters : mapping or jax.Array (q,), optional
        Values by name that replace defaults, or all in the order of ``system.parameter_names``.
    t_eval : array_like (K,), optional
        Times of the states to return; constants.
    **options
        Further options of :func:`nonsmooth.simulate`.

    Returns
    -------
    jax.Array (n,) or (K, n)
        The state at the end, or those at ``t_eval``.

    Raises
    ------
    DegenerateError
        As a JAX error with its text: the run ends with a status without an end, as NON_UNIQUE; or, in gradients, an
        event is grazed.

    Examples
    --------
    >>> import casadi as ca, nonsmooth as ns
    >>> x, a = ca.SX.sym("x"), ca.SX.sym("a")
    >>> system = ns.FilippovSystem([x], surface=x, above=[-1], below=[a], parameters={a: 2.0})
    >>> import jax
    >>> end = lambda a: ns.interop.jax.simulate(system, [-1.0], 0.25, {"a": a})[0]
    >>> float(jax.grad(end)(2.0))
    0.25
    """
    runs = Runs.of(system, t_end, t_eval, False, options)
    return _called(runs, x0, parameters)


def ensemble(
    system: FilippovSystem,
    x0: Any,
    t_end: float,
    parameters: Any = None,
    *,
    t_eval: Any = None,
    **options: Any,
) -> jax.Array:
    """Final states of many runs, or their states at given times.

    Parameters
    ----------
    system, t_end, t_eval : see :func:`simulate`
        The same for all runs.
    x0 : jax.Array (..., n)
        Starts.
    parameters : mapping or jax.Array (..., q), optional
        As for :func:`simulate`; arrays that broadcast with the starts give each run its own.
    **options
        Further options of :func:`nonsmooth.ensemble`.

    Returns
    -------
    jax.Array (..., n) or (..., K, n)
        NaN for runs that end with a status without an end, as NON_UNIQUE; so are their gradients.
    """
    runs = Runs.of(system, t_end, t_eval, True, options)
    return _called(runs, x0, parameters)


def _called(runs: Runs, x0: Any, parameters: Any) -> Any:
    jax, jnp = library("jax", "interop.jax", "jax"), library("jax.numpy", "interop.jax", "jax")
    x0 = jnp.asarray(x0, dtype=float)
    stack = lambda parts: (
        jnp.stack(jnp.broadcast_arrays(*parts), -1) if parts else jnp.zeros(0, x0.dtype)
    )
    p = parameters_of(runs.system, parameters, stack, lambda value: jnp.asarray(value, dtype=float))
    runs.require_shapes(x0.shape, p.shape)
    batch = jnp.broadcast_shapes(x0.shape[:-1], p.shape[:-1])
    x0, p = (jnp.broadcast_to(v, (*batch, v.shape[-1])) for v in (x0, p))

    def values(x0: Any, p: Any) -> Any:
        shape = jax.ShapeDtypeStruct(runs.shape(x0.shape), x0.dtype)
        host = lambda *given: runs.values(*map(_float64, given)).astype(x0.dtype)
        return jax.pure_callback(host, shape, x0, p, vmap_method="sequential")

    def pulled(kept: Any, rows: Any) -> Any:
        shapes = tuple(jax.ShapeDtypeStruct(v.shape, v.dtype) for v in kept)
        host = lambda *given: tuple(v.astype(x0.dtype) for v in runs.pulled(*map(_float64, given)))
        return jax.pure_callback(host, shapes, *kept, rows, vmap_method="sequential")

    run = jax.custom_vjp(values)
    run.defvjp(lambda x0, p: (values(x0, p), (x0, p)), pulled)
    return run(x0, p)


def _float64(value: Any) -> Any:
    return np.asarray(value, dtype=np.float64)

"""The one import of python-flint, with a clear error where it is missing."""

from __future__ import annotations

from ...model.errors import MissingError, explain

try:
    from flint import (
        arb,
        arb_mat,
        arb_series,
        ctx,
        fmpq,
        fmpq_mpoly,
        fmpq_mpoly_ctx,
    )
except ImportError as error:
    raise MissingError(
        explain(
            "proofs",
            expected="the package python-flint",
            received=f"no such package ({error})",
            advice="Install it with: pip install 'nonsmooth-dynamics[proofs]'.",
        )
    ) from error

__all__ = ["arb", "arb_mat", "arb_series", "ctx", "fmpq", "fmpq_mpoly", "fmpq_mpoly_ctx"]

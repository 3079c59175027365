"""The one import of python-flint, with a clear error where it is missing."""

from __future__ import annotations

from ...model.errors import MissingError

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
        f"proofs need the package python-flint ({error}). Install it with: "
        "pip install 'nonsmooth-dynamics[proofs]'."
    ) from error

__all__ = ["arb", "arb_mat", "arb_series", "ctx", "fmpq", "fmpq_mpoly", "fmpq_mpoly_ctx"]

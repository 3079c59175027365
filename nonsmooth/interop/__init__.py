"""Bridges to other libraries: ``jax`` and ``torch`` differentiate runs, ``sympy`` reads equations.

Each imports its library on first use; the extras ``nonsmooth-dynamics[jax]``, ``[torch]`` and ``[sympy]``
install them.
"""

from types import ModuleType

__all__ = ["jax", "sympy", "torch"]


def __getattr__(name: str) -> ModuleType:
    import importlib

    if name in __all__:
        return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module 'nonsmooth.interop' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__

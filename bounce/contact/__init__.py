"""What a surface is: the contract of contact models, their equations, friction laws and models."""

from .generalised import Condition, Conditions

__all__ = ["Condition", "Conditions"]

"""Nonsmooth dynamics on automatic Lie derivatives."""
from .model import *

"""Nonsmooth dynamics on automatic Lie derivatives."""
from .model import *
from .flow import *

"""The command ``bounce``: parser, exit codes, and errors in one line."""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from collections.abc import Sequence
from typing import Any, NoReturn

import nonsmooth as ns

from . import explore, fit, land, launch, map, models

_COMMANDS = (launch, land, map, fit, explore, models)
_CODES = (
    "Exit codes: 0 done, 1 a computation or a file failed, 2 wrong arguments, 3 a fit whose data do not "
    "determine a parameter."
)
_USAGE = (ns.ParameterError, ns.OptionError, ns.DefinitionError, ns.PointError)


class _Parser(argparse.ArgumentParser):
    """A parser that prints errors in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


class _Help(argparse.ArgumentDefaultsHelpFormatter):
    """Help that shows every default."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        given = "(default" in (action.help or "")
        none = action.default is None or action.default is False or action.default == []
        return action.help if given or none else super()._get_help_string(action)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        0 done, 1 a computation or a file failed, 2 wrong arguments, 3 a fit whose data do not
        determine a parameter.

    Examples
    --------
    >>> main("land --speed 28.5 --angle 37.3 --spin 2094 --turf natural".split())
    lift-off  10.7 m/s, 37.3 deg, -4536 rpm, slip -1.61 m/s (III+: slips, then rolls from
        compression on)
    run       23 m in 4.9 s (not validated): 13 bounces (10 of them outside the fit), the first 2.1 m
        high, over 23 m; rolls 0.2 m
    0
    """
    parser = _arguments()
    try:
        args = parser.parse_args(_joined(sys.argv[1:] if argv is None else argv))
        with warnings.catch_warnings():
            warnings.simplefilter("always", UserWarning)
            warnings.showwarning = _caution
            return int(args.run(args))
    except SystemExit as stop:
        return int(stop.code or 0)
    except (ns.NonsmoothError, OSError) as error:
        line = " ".join(str(error).split())
        print(f"bounce: error: {line}", file=sys.stderr)
        return 2 if isinstance(error, _USAGE) else 1
    except KeyboardInterrupt:
        print("bounce: interrupted", file=sys.stderr)
        return 130


def _arguments() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="bounce", description="The bounce of a spinning ball on the ground.", epilog=_CODES
    )
    parser.add_argument("--version", action="version", version=f"bounce {ns.__version__}")
    commands = parser.add_subparsers(metavar="command", required=True, parser_class=_Parser)
    for command in _COMMANDS:
        name = command.__name__.rpartition(".")[2]
        one = commands.add_parser(
            name, help=command.HELP, description=command.ABOUT, formatter_class=_Help
        )
        command.arguments(one)
        one.set_defaults(run=command.run, command=name)
    return parser


def _joined(argv: Sequence[str]) -> list[str]:
    """Join an option and its negative number with a unit, which argparse takes for an option."""
    joined: list[str] = []
    for argument in argv:
        before = joined[-1] if joined else ""
        if re.match(r"-[\d.]", argument) and re.fullmatch(r"--[a-z-]+", before):
            joined[-1] = f"{before}={argument}"
        else:
            joined.append(argument)
    return joined


def _caution(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"bounce: caution: {' '.join(str(message).split())}", file=sys.stderr)

"""The command `quell`, which the package carries."""

from __future__ import annotations

import sys

from . import _quell


def main() -> int:
    """Does what the command line says; returns the exit status."""
    return _quell.run_command(["quell", *sys.argv[1:]], str(_quell.__file__))

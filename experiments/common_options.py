"""What the commands that compare methods have in common: options, and how errors are told."""

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path


def comparing(doc: str | None) -> argparse.ArgumentParser:
    """A command that goes over the drawings of a data set by methods, in a folder OUT."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    add_data_options(parser)
    parser.add_argument("--methods", help="comma-separated; all by default")
    parser.add_argument("--styles", help="comma-separated; all by default")
    return parser


def add_data_options(parser: argparse.ArgumentParser) -> None:
    """Let a script be told where its data set lies, and how large to take it."""
    parser.add_argument("--data", type=Path, default=os.environ.get("STROKESTYLE_SHARED"))
    parser.add_argument("--train", help="the shape that styles are learned from")
    parser.add_argument("--size", type=int, default=256, help="px, the longer side of all images")


def carry_out(run: Callable[[argparse.Namespace], None], parser: argparse.ArgumentParser) -> None:
    """Run a command; what a person can put right is told in one line, with exit code 1."""
    try:
        run(parser.parse_args())
    except (OSError, ValueError) as error:
        sys.exit(str(error))

"""Make docs/cli.md anew from the help texts of all commands: python docs/cli_reference.py"""

from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner

from strokestyle.cli import main

PAGE = Path(__file__).parent / "cli.md"
WIDTH = 100  # columns of the terminal that the help is printed for
HEAD = """# Commands

Made by `python docs/cli_reference.py` from what `strokestyle --help` and the `--help` of each
command print. The commands stand in the order of the work: find the lines, learn a hand, draw with
it, change the drawing, look at it.

Every command tells on stderr what it did; `-q` silences that, `-v` adds how long each stage took.
An error is one line on stderr, and then the exit code is 1; it is 2 where the command line itself
is wrong, and 130 after Ctrl-C. An output that cannot be written whole is not written at all.
"""


def help_text(*command: str) -> str:
    """What `strokestyle COMMAND --help` prints on a terminal of WIDTH columns."""
    result = CliRunner().invoke(
        main, [*command, "--help"], terminal_width=WIDTH, prog_name="strokestyle"
    )
    return result.output


def page() -> str:
    """The whole of docs/cli.md."""
    commands = [(), *((name,) for name in main.commands)]
    return HEAD + "".join(
        f"\n## {' '.join(('strokestyle', *command))}\n\n```text\n{help_text(*command)}```\n"
        for command in commands
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

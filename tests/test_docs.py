"""The README is run: its shell blocks, its Python blocks, and the help texts that it prints."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from strokestyle import cli

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.M | re.S)


def help_text(command):
    """As a terminal 100 columns wide shows it."""
    return (
        CliRunner()
        .invoke(cli.main, [command, "--help"], terminal_width=100, prog_name="strokestyle")
        .output
    )


@pytest.mark.parametrize("command", sorted(cli.main.commands))
def test_every_command_stands_in_the_readme_with_its_options(command):
    shown = re.search(rf"<!-- help {command} -->\n```text\n(.*?)```", README, re.S)
    assert shown, f"README.md has no help of {command}"
    assert shown[1] == help_text(command), (
        "README.md is behind the help text: run python tests/test_docs.py"
    )


def test_every_command_has_help_and_its_options_too():
    for command in cli.main.commands.values():
        assert command.help and command.epilog
        for parameter in command.params:
            assert isinstance(parameter, click.Argument) or parameter.help, (
                f"{command.name} {parameter.name}"
            )


def test_files_that_the_readme_names_exist():
    for name in re.findall(r"\]\(((?!http)[^)#]+)\)|src=\"((?!http)[^\"]+)\"", README):
        assert (ROOT / (name[0] or name[1])).exists(), name


def test_the_readme_runs_from_top_to_bottom(tmp_path):
    """Blocks marked sh are run in one folder, in order; those marked console are for the reader to choose from."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    env = dict(os.environ, PATH=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    for block in blocks("sh"):
        done = subprocess.run(
            ["bash", "-euc", block], cwd=tmp_path, env=env, capture_output=True, text=True
        )
        assert done.returncode == 0, f"{block}\n{done.stderr}"
    for block in blocks("python"):
        done = subprocess.run(
            [sys.executable, "-c", block], cwd=tmp_path, env=env, capture_output=True, text=True
        )
        assert done.returncode == 0, f"{block}\n{done.stderr}"


def rewrite_help():
    text = README
    for command in cli.main.commands:
        shown = f"<!-- help {command} -->\n```text\n{help_text(command)}```"
        text = re.sub(
            rf"<!-- help {command} -->\n```text\n.*?```", lambda _, s=shown: s, text, flags=re.S
        )
    (ROOT / "README.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    rewrite_help()

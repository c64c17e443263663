"""The README is run, its shell blocks and its Python blocks; the pages made from the code are current."""

import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import click

from strokestyle import cli

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.M | re.S)


def test_the_page_of_commands_is_current():
    made = runpy.run_path(str(ROOT / "docs" / "cli_reference.py"))
    assert made["PAGE"].read_text(encoding="utf-8") == made["page"](), (
        "docs/cli.md is behind the help texts: run python docs/cli_reference.py"
    )
    for command in cli.main.commands:
        assert f"## strokestyle {command}\n" in made["page"]()


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

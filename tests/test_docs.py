"""README and docs are run, shell blocks and Python blocks; the pages made from the code are
current."""

import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest

from strokestyle import cli

ROOT = Path(__file__).parent.parent
# The README first: it makes what the pages of docs/ go on with.
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "CONTRIBUTING.md"]


def blocks(page):
    """(language, text) of the blocks that are run; those marked console are for the reader to
    choose from."""
    text = page.read_text(encoding="utf-8")
    return re.findall(r"^( *)```(sh|python)\n(.*?)^ *```", text, re.M | re.S)


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


def test_the_page_of_python_names_is_current():
    made = runpy.run_path(str(ROOT / "docs" / "api.py"))
    assert made["PAGE"].read_text(encoding="utf-8") == made["page"](), (
        "docs/python.md is behind the docstrings: run python docs/api.py"
    )


def test_the_readme_is_one_page():
    assert len(PAGES[0].read_text(encoding="utf-8").splitlines()) <= 250


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    links = re.findall(r"\]\(((?!http)[^)#]+)[^)]*\)|src=\"((?!http)[^\"]+)\"", text)
    scripts = re.findall(r"python ((?:docs|benchmarks|examples|experiments)/\w+\.py)", text)
    for name in [link or source for link, source in links]:
        assert (page.parent / name).exists(), name
    for name in scripts:
        assert (ROOT / name).exists(), name


def test_readme_and_docs_run_from_top_to_bottom(tmp_path):
    """Page by page in one folder: what one block writes, the next ones may use."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    env = dict(os.environ, PATH=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    runs = {"sh": ["bash", "-euc"], "python": [sys.executable, "-c"]}
    done = 0
    for page in PAGES:
        for indent, language, block in blocks(page):
            command = [*runs[language], re.sub(f"^{indent}", "", block, flags=re.M)]
            made = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)
            assert made.returncode == 0, f"{page.name}: {block}\n{made.stderr}"
            done += 1
    assert done >= 10

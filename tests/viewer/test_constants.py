"""The page's scripts take what they share with Python from one table, and keep none of it."""

import json
import re
import shutil
import subprocess

import pytest

from strokestyle.drawing import edit, outline, ribbon, strip
from strokestyle.svg import format, ink, tones
from strokestyle.viewer import page
from strokestyle.viewer.constants import shared_constants

MODULES = {"ribbon": ribbon, "edit": edit, "outline": outline, "strip": strip, "ink": ink}
MODULES |= {"tones": tones, "format": format}
SCRIPTS = {name: page.page_text(name) for name in page.PAINTER + page.SCRIPTS}
TAKEN = re.compile(r"const \{([^}]*)\} = CONSTANTS\.(\w+);")


def told(text):
    """The table in a page's text."""
    return json.loads(re.search(r"const CONSTANTS = (.*);\n", text)[1])


def test_the_page_is_told_pythons_values():
    table = told(page.page_html([("a.svg", "<svg/>")]))
    assert table.keys() == {*MODULES, "options"}
    for group, module in MODULES.items():
        assert table[group] == {name: getattr(module, name) for name in table[group]}
    defaults = format.SvgOptions()
    assert table["options"] == {name: getattr(defaults, name) for name in table["options"]}


def test_scripts_take_what_is_there_and_say_no_name_or_number_of_their_own():
    table = shared_constants()
    names = {name for group in table.values() for name in group}
    for script, text in SCRIPTS.items():
        for taken, group in TAKEN.findall(text):
            assert set(re.findall(r"\w+", taken)) <= set(table[group]), script
        assert set(re.findall(r"CONSTANTS\.options\.(\w+)", text)) <= set(table["options"]), script
        assert set(re.findall(r"\bATTRIBUTES\.(\w+)", text)) <= set(format.ATTRIBUTES), script
        assert not names & set(re.findall(r"^const (\w+) =", text, re.M)), script
        assert "data-ss-" not in text, script
    for script in ("document.js", "tones.js", "outline.js"):  # those that write a file
        for value in ("0.04", "0.06", "0.004", "0.15", "0.97", "1.75", "64", "128", "85_?000"):
            assert not re.search(rf"(?<![\w.]){value}(?![\w.])", SCRIPTS[script]), (script, value)


def test_scripts_use_all_that_they_are_told():
    used = {
        (group, name)
        for text in SCRIPTS.values()
        for taken, group in TAKEN.findall(text)
        for name in re.findall(r"\w+", taken)
    }
    for group, constants in shared_constants().items():
        if group not in ("format", "options"):  # the format is told whole
            assert {(group, name) for name in constants} <= used


@pytest.mark.skipif(not shutil.which("node"), reason="no program: node is not installed")
def test_the_scripts_see_the_table():
    names = [*page.PAINTER, *(name for name in page.SCRIPTS if name != "app.js")]
    table = shared_constants()
    taken = {
        name: group
        for script in names
        for some, group in TAKEN.findall(SCRIPTS[script])
        for name in re.findall(r"\w+", some)
    }
    code = f"const CONSTANTS = {json.dumps(table)};\n" + "".join(SCRIPTS[name] for name in names)
    code += f"console.log(JSON.stringify({{{', '.join(taken)}}}));"
    done = subprocess.run(["node", "-"], input=code, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {name: table[group][name] for name, group in taken.items()}

"""The options of `strokestyle edit`: in the order given, and refused in one sentence."""

import click
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner
from small_drawings import drawing

from strokestyle import cli
from strokestyle.svg.write import save_svg


def context_of(*words, **settings):
    """What click makes of `strokestyle edit WORDS`, before the command runs."""
    parent = cli.main.make_context("strokestyle", ["edit"])
    return cli.main.commands["edit"].make_context("edit", list(words), parent=parent, **settings)


IN_OUT = ("in.svg", "-o", "out.svg")


@pytest.mark.parametrize(
    "words, edits",
    [
        (["in.svg", "-o", "out.svg"], []),
        (
            ["--smooth", "1", "in.svg", "--wiggle", "2,9", "-o", "out.svg", "--smooth=3"],
            [("smooth", "1"), ("wiggle", "2,9"), ("smooth", "3")],
        ),
        (
            [*IN_OUT, "--thickness=contour=2", "--drop", "<1", "--thickness", "valley=0.5"],
            [("thickness", "contour=2"), ("drop", "<1"), ("thickness", "valley=0.5")],
        ),
        # values that look like options are values
        (
            ["in.svg", "-oout.svg", "--taper", "--smooth", "--smooth", "-o"],
            [("taper", "--smooth"), ("smooth", "-o")],
        ),
        (["-o", "--smooth", "in.svg", "--taper", "2"], [("taper", "2")]),
        (["-qo", "out.svg", "--taper", "2", "in.svg", "-v"], [("taper", "2")]),
        (["-o", "out.svg", "--taper", "2", "--", "in.svg"], [("taper", "2")]),
        (["-o", "out.svg", "--taper", "2", "--", "--smooth"], [("taper", "2")]),
        # flags, other options and shortened values between them
        (
            [*IN_OUT, "--png", "--drop=valley", "--seed", "5", "--move", "s1:0:1,1", "-q"]
            + ["--restyle", "m.pt", "--title=--drop", "--drop", ">9", "--recolor", "navy"],
            [
                ("drop", "valley"),
                ("move", "s1:0:1,1"),
                ("restyle", "m.pt"),
                ("drop", ">9"),
                ("recolor", "navy"),
            ],
        ),
    ],
)
def test_edits_keep_the_order_of_the_command_line(monkeypatch, words, edits):
    monkeypatch.setattr("strokestyle.cli.edit_text.parse_edit", lambda name, text: text)
    params = context_of(*words).params
    assert [tuple(given) for given in params["edits"]] == edits
    assert params["drawing"] == words[-1] if "--" in words else params["drawing"] == "in.svg"
    assert not {"smooth", "wiggle", "drop"} & set(params)


def test_words_are_completed_where_an_edit_is_unfinished():
    for words in (["in.svg", "--smooth"], ["in.svg", "--smooth", "x", "--taper", "3"]):
        assert len(context_of(*words, resilient_parsing=True).params["edits"]) <= 2
    complete = ShellComplete(cli.main, {}, "strokestyle", "_COMPLETE").get_completions
    words = ["edit", "in.svg", "--smooth", "x", "--taper", "3"]
    assert [item.value for item in complete(words, "--simp")] == ["--simplify"]
    assert [item.type for item in complete([*words, "--restyle"], "m")] == ["file"]
    assert complete([*words, "--smooth"], "1") == []


@pytest.mark.parametrize(
    "option, text, sentence",
    [
        ("thickness", "-1", "--thickness must lie between 0 and 1000, got -1"),
        ("thickness", "contour=-1", "--thickness must lie between 0 and 1000, got -1"),
        ("thickness", "x", "--thickness takes a number, got 'x'"),
        ("wiggle", "-1,9", "the amplitude of --wiggle must lie between 0 and 10000, got -1"),
        ("wiggle", "1,0", "the wavelength of --wiggle must lie between 0.5 and 100000, got 0"),
        ("wiggle", "3", "--wiggle takes two numbers, such as 4,30, got '3'"),
        ("smooth", "-2", "--smooth must lie between 0 and 10000, got -2"),
        ("simplify", "-2", "--simplify must lie between 0 and 10000, got -2"),
        ("taper", "nan", "--taper takes a number, got 'nan'"),
        ("taper", "-3", "--taper must lie between 0 and 100000, got -3"),
        ("move", "s1:2:1,1", "the point of --move must lie between 0 and 1, got 2"),
        ("move", "s1:1:1e7,1", "the way of --move must lie between -1e+06 and 1e+06, got 1e+07"),
        (
            "move",
            "s1:1",
            "--move is STROKE:POINT:DX,DY, for instance s004:0.5:20,-10, got 's1:1'",
        ),
        (
            "recolor",
            "hue",
            "--recolor takes a colour, #rrggbb or a name such as navy, got 'hue'",
        ),
    ],
)
def test_what_is_wrong_with_an_edit_is_one_sentence(tmp_path, option, text, sentence):
    save_svg(tmp_path / "in.svg", drawing())
    words = ["edit", tmp_path / "in.svg", "-o", tmp_path / "out.svg", f"--{option}={text}"]
    result = CliRunner().invoke(cli.main, list(map(str, words)))
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == f"Error: {sentence}"
    assert not (tmp_path / "out.svg").exists()


def test_a_bad_command_line_is_refused_as_click_refuses_it():
    for words in (["in.svg", "-o"], ["in.svg", "-o", "out.svg", "--smoth", "3"], []):
        with pytest.raises(click.UsageError):
            context_of(*words)

"""The journal of a batch: its lines, torn ones, and whether a drawing is the one that is wanted."""

import json
import os

import pytest

from strokestyle.batch.journal import NAME, Journal, is_whole, read_journal
from strokestyle.batch.keys import content_digest, settings_key, shape_key
from strokestyle.batch.outcome import Outcome


def outcome(name, folder="out", **values):
    return Outcome(f"in/{name}.obj", os.path.join(folder, f"{name}.svg"), **values)


def test_a_line_reads_as_it_was_written():
    one = outcome("ü b", files=("out/ü b.svg", "out/ü b.png"), seconds=1.25, lines=3, strokes=4,
                  warnings=("it is open",), key="k", digest="d", memory_mb=None)  # fmt: skip
    assert Outcome.from_json(one.to_json()) == one
    line = one.to_json("out")
    assert json.loads(line)["files"] == ["ü b.svg", "ü b.png"] and "\n" not in line
    moved = Outcome.from_json(line, "elsewhere")
    assert moved.output == os.path.join("elsewhere", "ü b.svg")
    assert Outcome.from_json(line[:-1] + ', "later": 1}', "out") == one


def test_an_error_and_its_kind_go_together():
    assert not outcome("a", error="no", failure="timeout").drawn
    for values in ({"error": "no"}, {"failure": "error"}, {"error": "no", "failure": "other"}):
        with pytest.raises(ValueError, match="Outcome.failure"):
            outcome("a", **values)


@pytest.mark.parametrize(
    "line", ["", "{", "[]", "3", "null", '"a"', "{}", '{"shape": "a"}', "[" * 5000,
             '{"shape": "a", "output": "b", "files": 3}', '{"shape": 1, "output": 2}',
             '{"shape": "a", "output": "b", "error": "no"}', b"\xff\xfe",
             *(f'{{"shape": "a", "output": "b", {field}}}' for field in (
                 '"seconds": null', '"seconds": NaN', '"seconds": 1e400', '"cpu_seconds": "2"',
                 '"memory_mb": []', '"memory_mb": -1', '"lines": 1.5', '"strokes": true',
                 '"attempts": 1' + 400 * "0", '"key": 5', '"files": "b"', '"files": ["b\\u0000"]',
                 '"warnings": [null]', '"error": 5, "failure": "error"')),
             ],
)  # fmt: skip
def test_what_is_no_line_is_refused(line):
    with pytest.raises(ValueError, match="no line of a batch's journal"):
        Outcome.from_json(line, "out")


def test_a_torn_line_goes_and_the_last_of_a_drawing_holds(tmp_path):
    folder = str(tmp_path)
    one, two = outcome("one", folder), outcome("two", folder, error="no", failure="error")
    lines = [
        one.to_json(folder),
        two.to_json(folder),
        outcome("one", folder, lines=7).to_json(folder),
    ]
    (tmp_path / NAME).write_text("\n".join(lines) + "\n" + lines[0][:30])
    assert [(o.output, o.lines) for o in read_journal(folder)] == [(two.output, 0), (one.output, 7)]

    journal = Journal(folder, lambda old: old.output != two.output)
    assert (tmp_path / NAME).read_text() == lines[2] + "\n"
    journal.add(two)
    with open(tmp_path / NAME, "a") as other:  # another run is killed over its line
        other.write(lines[0][:30])
    journal.add(outcome("three", folder))
    journal.close()
    assert [one.shape for one in read_journal(folder)] == [
        "in/one.obj",
        "in/two.obj",
        "in/three.obj",
    ]
    assert (tmp_path / NAME).read_bytes().endswith(b"}\n")


def test_two_runs_at_the_same_time_write_to_one_journal(tmp_path):
    folder = str(tmp_path)
    first, second = (Journal(folder, lambda old: old.shape != "in/b0.obj") for _ in range(2))
    for k in range(3):
        first.add(outcome(f"a{k}", folder))
        second.add(outcome(f"b{k}", folder))
    Journal(folder, lambda old: old.shape != "in/b0.obj").close()
    first.add(outcome("a3", folder))
    assert [one.shape[3:5] for one in read_journal(folder)] == ["a0", "a1", "b1", "a2", "b2", "a3"]
    first.close()
    second.close()


def test_equal_runs_at_the_same_time_leave_one_line_for_each_drawing(tmp_path):
    folder = str(tmp_path)
    first, second = (Journal(folder, lambda old: False) for _ in range(2))
    for k in range(3):
        first.add(outcome(f"a{k}", folder))
        second.add(outcome(f"a{k}", folder))
    second.add(outcome("a", folder))
    lines = (tmp_path / NAME).read_bytes().splitlines()
    assert len(lines) == 4 and [one.shape[3:-4] for one in read_journal(folder)] == [
        "a0", "a1", "a2", "a",
    ]  # fmt: skip
    first.close()
    second.close()


def test_a_journal_that_cannot_be_written_is_named(tmp_path):
    journal = Journal(str(tmp_path), lambda old: True)
    os.close(journal._file)
    journal._file = os.open(journal.path, os.O_RDONLY)  # as a disk that is full
    with pytest.raises(OSError) as told:
        journal.add(outcome("one", str(tmp_path)))
    assert told.value.filename == journal.path
    journal.close()


def test_what_is_no_journal_is_named(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_journal(tmp_path)
    (tmp_path / NAME).write_text("dear diary\nI drew a cow\n")
    with pytest.raises(ValueError, match="batch.jsonl: no journal of a batch"):
        read_journal(tmp_path)
    with pytest.raises(ValueError, match="batch.jsonl: no journal of a batch"):
        Journal(str(tmp_path), lambda old: True)
    assert (tmp_path / NAME).read_text() == "dear diary\nI drew a cow\n"
    (tmp_path / NAME).write_text("")
    assert read_journal(tmp_path) == []


def test_a_drawing_is_whole_as_it_was_written(tmp_path):
    files = [str(tmp_path / name) for name in ("a.svg", "a.png")]
    for file in files:
        with open(file, "w") as out:
            out.write("drawing")
    one = outcome("a", files=tuple(files), digest=content_digest(files))
    assert is_whole(one)
    (tmp_path / "a.png").write_text("drawin")
    assert not is_whole(one)
    (tmp_path / "a.png").unlink()
    assert not is_whole(one)
    assert not is_whole(outcome("a", error="no", failure="error"))


def test_a_key_is_of_content_and_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("a.obj", "mesh"), ("b.obj", "mesh"), ("m.pt", "model"), ("n.pt", "model")):
        (tmp_path / name).write_text(text)
    settings = settings_key({"model": "m.pt", "shape": {"view": "side"}})
    key = shape_key(settings, "a.obj")
    os.utime("a.obj", (1, 1))
    assert key == shape_key(settings, str(tmp_path / "a.obj"))  # touched, and called otherwise
    assert settings == settings_key({"model": "n.pt", "shape": {"view": "side"}})
    others = {shape_key(settings, "b.obj"), settings_key({"model": "m.pt", "shape": {}})}
    (tmp_path / "a.obj").write_text("mash")
    others.add(shape_key(settings, "a.obj"))
    (tmp_path / "m.pt").write_text("modem")
    others.add(settings_key({"model": "m.pt", "shape": {"view": "side"}}))
    assert len(others | {key, settings}) == 6


def test_a_key_is_of_the_files_that_a_shape_names(tmp_path):
    shape = tmp_path / "a.gltf"
    shape.write_text(json.dumps({"buffers": [{"uri": "my%20data.bin"}, {"uri": "data:,x"}]}))
    (tmp_path / "my data.bin").write_text("1")
    key = shape_key("", str(shape))
    (tmp_path / "my data.bin").write_text("2")
    assert key != shape_key("", str(shape))
    for text in ("{", "[]", '{"buffers": [3]}'):
        shape.write_text(text)
        assert shape_key("", str(shape))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names")
def test_a_pipe_is_not_opened(tmp_path):
    os.mkfifo(tmp_path / "a.obj")
    assert shape_key("", str(tmp_path / "a.obj")) == ""

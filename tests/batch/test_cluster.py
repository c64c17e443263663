"""Batches drawn at the workers of a Dask scheduler on loopback."""

import json
import shutil
import signal
import socket
import subprocess
import sys

import dask.config
import pytest
import trimesh
from command import refused, run
from dask_cluster import Cluster
from small_styles import plain_style

from strokestyle import __version__
from strokestyle.batch import cluster as module
from strokestyle.batch.cluster import pack
from strokestyle.batch.plan import Job
from strokestyle.render.style_file import save_style

HERE = ("seconds", "cpu_seconds", "memory_mb", "worker")  # of a journal, not of the drawing
SMALL = ("--size", "96", "--crease", "30")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a model, a camera, and shapes: meshes, one of two files, a bad one."""
    folder = tmp_path_factory.mktemp("cluster")
    save_style(folder / "model.pt", plain_style(96))
    (folder / "in").mkdir()
    for k in range(4):
        trimesh.creation.box((1, 1 + 0.2 * k, 1)).export(folder / "in" / f"box {k}.ply")
    (folder / "in" / "bad.obj").write_text("dear diary\n")
    write_gltf(folder / "in" / "two.gltf", folder / "data" / "a_b.bin")
    camera = {"projection": "parallel", "eye": [3, 2, 4], "target": [0, 0, 0], "up": [0, 1, 0]}
    (folder / "camera.json").write_text(json.dumps({**camera, "extent": 3, "size": [96, 96]}))
    return folder


def write_gltf(path, data):
    """A box whose coordinates lie in another folder, under a name that is escaped."""
    files = trimesh.exchange.gltf.export_gltf(
        trimesh.Scene(trimesh.creation.box()), merge_buffers=True
    )
    tree = json.loads(files["model.gltf"])
    data.parent.mkdir()
    data.write_bytes(files[tree["buffers"][0]["uri"]])
    tree["buffers"][0]["uri"] = f"../{data.parent.name}/{data.name.replace('_', '%5F')}"
    path.write_text(json.dumps(tree))


@pytest.fixture(scope="module")
def workers(tmp_path_factory):
    """Two workers; they talk by TLS where openssl can make certificates."""
    folder = tmp_path_factory.mktemp("dask")
    names = certificates(folder) if shutil.which("openssl") else {}
    with dask.config.set(config_of(names)), Cluster(folder, tls=names) as started:
        assert started.address.startswith("tls://" if names else "tcp://")
        yield started


def certificates(folder):
    """A certificate authority, and a certificate that it signed: files by their names in Dask."""
    new = "openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN="
    for command in (
        f"{new}authority -x509 -days 2 -keyout ca.key -out ca.pem",
        f"{new}test -keyout key.pem -out request.pem",
        "openssl x509 -req -in request.pem -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 "
        "-out cert.pem",
    ):
        subprocess.run(command.split(), cwd=folder, check=True, capture_output=True)
    return {name: str(folder / f"{name}.pem") for name in ("ca", "cert", "key")}


def config_of(names):
    """What the client is told in Dask's configuration."""
    tls = "distributed.comm.tls."
    places = {"ca": f"{tls}ca-file", "cert": f"{tls}client.cert", "key": f"{tls}client.key"}
    return {places[name]: file for name, file in names.items()}


def drawings(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.suffix != ".jsonl"}


@pytest.fixture(autouse=True)
def inside(place, monkeypatch):
    monkeypatch.chdir(place)


# -------------------------------------------------------------------------------- as on one machine


def test_a_batch_is_that_of_one_machine_though_a_worker_is_killed(place, workers, monkeypatch):
    """The same bytes, journal and words; the bad mesh costs itself alone, the lost worker nothing;
    with --resume nothing is drawn again."""
    expected, said = {}, []
    (place / "here").mkdir()
    for shape in sorted((place / "in").iterdir()):
        words = ("render", "model.pt", f"in/{shape.name}", "-o", f"here/{shape.stem}.svg", "--png")
        done = run(*words, *SMALL, "--json")
        expected[shape.name] = json.loads(done.stdout)
        said += done.stderr.replace("here/", "there/").splitlines()

    killed = []
    write = module.write_bytes

    def write_and_kill(path, data):
        write(path, data)
        if not killed:
            killed.append(workers.workers.pop())
            killed[0].send_signal(signal.SIGKILL)

    monkeypatch.setattr(module, "write_bytes", write_and_kill)
    words = ("render", "model.pt", "in", "-o", "there", "--png", *SMALL)
    done = run(*words, "--scheduler", workers.address)
    assert done.exit_code == 1 and killed, done.stderr
    assert sorted(done.stderr.splitlines()) == sorted([*said, "5 of 6 shapes drawn"])
    assert drawings(place / "there") == drawings(place / "here")
    told = (place / "there" / "batch.jsonl").read_text().splitlines()
    assert len(told) == 6
    for line in map(json.loads, told):
        other = expected[line["shape"].removeprefix("in/")]
        assert [f"there/{name}" for name in line.pop("files")] == [
            name.replace("here/", "there/") for name in other.pop("files")
        ]
        assert line.pop("attempts") in (1, 2)
        for name in line.keys() - {*HERE, "output"}:
            assert line[name] == other[name], name

    good = [f"in/{shape.name}" for shape in (place / "in").iterdir() if shape.stem != "bad"]
    again = run("render", "model.pt", *good, *words[3:], "--scheduler", workers.file, "--resume")
    assert again.exit_code == 0 and again.stderr == "5 of 5 shapes are drawn already\n"


def test_files_that_options_name_are_sent_and_films_brought_back(place, workers):
    words = ("render", "model.pt", "in/two.gltf", "--camera", "camera.json", "--turntable", "2")
    for out, where in (("spin", ()), ("away", ("--scheduler", workers.address))):
        (place / out).mkdir()
        done = run(*words, "-o", f"{out}/", "-o", f"{out}/film.gif", *where)
        assert done.exit_code == 0, done.stderr
        assert f"{out}/film.gif" in done.stderr
    assert drawings(place / "spin") == drawings(place / "away")
    assert set(drawings(place / "spin")) == {"two-000.svg", "two-001.svg", "film.gif"}


def test_a_shape_is_sent_with_what_lies_beside_it(place):
    parcel = pack(Job(str(place / "in" / "two.gltf"), "drawings/two.svg"))
    assert parcel.shape == "in/two.gltf" and parcel.output == "two.svg"
    assert set(parcel.files) == {"in/two.gltf", "data/a_b.bin"}
    assert parcel.home == (str(place / "in") + "/", "drawings/")
    assert pack(Job("nothing.obj", "x.svg")).files == {}


# ---------------------------------------------------------------------------------- what is refused


def test_a_shape_has_its_time_there(place, workers):
    late = ("--scheduler", workers.address, "--timeout", "0.001")
    words = ["in/two.gltf: not drawn in 0.001 s"]
    refused("render", "model.pt", "in/two.gltf", "-o", "late.svg", *late, words=words)
    assert not (place / "late.svg").exists()


def test_a_model_that_none_can_read_is_told_once(place, workers):
    (place / "cut.pt").write_bytes((place / "model.pt").read_bytes()[:500])
    words = ["strokestyle: cut.pt: the model file is cut short"]
    out = ("-o", "none", "--scheduler", workers.address)
    refused("render", "cut.pt", "in", *out, words=words)
    assert not list((place / "none").glob("*.svg"))


def test_a_scheduler_that_is_not_there(monkeypatch):
    words = ("render", "model.pt", "in", "-o", "none", "--scheduler")
    monkeypatch.setattr(module, "PATIENCE", 0.3)
    with socket.socket() as taken:  # bound, and does not listen
        taken.bind(("127.0.0.1", 0))
        nobody = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        refused(*words, nobody, words=[nobody, "no Dask scheduler answers", "`dask scheduler`"])
    refused(*words, "what://is.this:1", words=["what://is.this:1", "unknown address scheme"])
    with dask.config.set(config_of(dict.fromkeys(("ca", "cert", "key")))):
        refused(*words, "tls://127.0.0.1:1", words=["tls://127.0.0.1:1", "TLS"])
    refused(*words, "gone.json", words=["gone.json: no such file", "--scheduler-file"])
    refused(*words, nobody, "--jobs", "2", words=["--jobs is for this machine"], code=2)
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "strokestyle.batch.cluster")
    monkeypatch.delattr("strokestyle.batch.cluster")
    refused(*words, nobody, words=["distributed", "pip install 'strokestyle[cluster]'"])


def test_a_worker_of_another_version_is_refused(workers, monkeypatch):
    monkeypatch.setattr(module, "__version__", "0.0.1")
    words = [
        "the worker tls://" if shutil.which("openssl") else "tcp://",
        f"has strokestyle {__version__}, and this is 0.0.1",
    ]
    out = ("-o", "none", "--scheduler", workers.address)
    refused("render", "model.pt", "in", *out, words=words)


def test_a_worker_without_strokestyle_is_refused(monkeypatch):
    plugin = module._Plugin("1.2.3", b"")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "strokestyle", None)
        plugin.setup(None)
    assert plugin.refusal == "has no strokestyle: install 1.2.3 of it there"
    plugin = module._Plugin(__version__, b"")
    plugin.setup(None)
    assert plugin.refusal.startswith("cannot begin: EOFError")

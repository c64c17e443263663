"""A `strokestyle` for the PATH of shell scripts that starts at once.

A server has imported all that a drawing takes, and forks for each command: a script that calls
strokestyle several times is tested as it stands, without waiting for as many imports.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

CLIENT = """#!{python} -IS
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect({address!r})
    words = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode()
    socket.send_fds(server, [len(words).to_bytes(8, "big")], [0, 1, 2])
    server.sendall(words)
    answer = server.recv(1)
sys.exit(answer[0] if answer else 99)
"""
MODULES = (
    "batch.report", "batch.journal", "extract.pipeline", "film.gif", "mesh.read", "motion.draw",
    "render.style_file", "svg.write",
)  # fmt: skip


class QuickCommand:
    """Used as a context: `folder` has the command `strokestyle` in it."""

    def __enter__(self):
        self.place = tempfile.TemporaryDirectory(prefix="quick-")
        self.folder = self.place.name
        address = f"{self.folder}/socket"
        program = Path(self.folder, "strokestyle")
        program.write_text(CLIENT.format(python=sys.executable, address=address))
        program.chmod(0o755)
        self.server = subprocess.Popen(
            [sys.executable, __file__, address],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1"},
            stdout=subprocess.PIPE,
        )
        assert self.server.stdout.readline() == b"ready\n"
        return self

    def __exit__(self, *error):
        self.server.kill()
        self.server.wait()
        self.server.stdout.close()
        self.place.cleanup()


def serve(address):
    """Take commands, one at a time or many."""
    import json
    import signal
    from importlib import import_module

    from strokestyle.cli import main

    for name in MODULES:
        import_module(f"strokestyle.{name}")
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(address)
        server.listen()
        print("ready", flush=True)
        while True:
            client, _ = server.accept()
            if os.fork():
                client.close()
                continue
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            head, files, _, _ = socket.recv_fds(client, 8, 3)
            with client.makefile("rb") as stream:
                words, folder, environment = json.loads(stream.read(int.from_bytes(head, "big")))
            for number, file in enumerate(files):
                os.dup2(file, number)
            os.chdir(folder)
            os.environ.clear()
            os.environ.update(environment)
            code = 98
            try:
                main(words, prog_name="strokestyle")
            except SystemExit as end:
                code = end.code or 0
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                client.sendall(bytes([code]))
                os._exit(0)


if __name__ == "__main__":
    serve(sys.argv[1])

"""A Dask scheduler and its workers on loopback, each a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path


class Cluster:
    """A scheduler and workers of one thread each, started as a user starts them; used as a context.

    Parameters
    ----------
    folder : for what they write
    workers : how many to begin with
    tls : files of "ca", "cert" and "key", or nothing for TCP
    """

    def __init__(self, folder: Path, workers: int = 2, tls: Mapping[str, str] | None = None):
        self.folder = folder
        flags = {"ca": "--tls-ca-file", "cert": "--tls-cert", "key": "--tls-key"}
        self.tls = [word for name in tls or {} for word in (flags[name], tls[name])]
        self.file = folder / "scheduler.json"
        self.workers: list[subprocess.Popen] = []
        self.count = workers

    def __enter__(self):
        words = ("--scheduler-file", self.file, "--host", "127.0.0.1", "--port", "0")
        if self.tls:
            words = (*words, "--protocol", "tls")
        self.scheduler = self.start("scheduler", *words, "--no-dashboard")
        for _ in range(self.count):
            self.add_worker()
        end = time.monotonic() + 60
        while not self.file.exists():
            assert time.monotonic() < end, "the scheduler does not start"
            time.sleep(0.02)
        self.address = json.loads(self.file.read_text())["address"]
        return self

    def __exit__(self, *error):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def add_worker(self, **environment):
        """One more, without a nanny: what is killed stays away."""
        words = ("--scheduler-file", self.file, "--nthreads", "1", "--no-nanny", "--no-dashboard")
        place = ("--host", "127.0.0.1", "--local-directory", self.folder)
        self.workers.append(self.start("worker", *words, *place, **environment))

    def start(self, what, *words, **environment):
        path = os.pathsep.join(sys.path)
        environment = {"PYTHONPATH": path, "OMP_NUM_THREADS": "1", **environment}
        return subprocess.Popen(
            [sys.executable, "-m", "dask", what, *map(str, words), *self.tls],
            env={**os.environ, **environment},
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

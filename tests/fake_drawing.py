"""What workers draw in tests of the batch: shapes whose names say what goes wrong with them."""

import os
import signal
import time
from pathlib import Path

from strokestyle.batch.outcome import Outcome
from strokestyle.files import replace_file


def prepare():
    return draw


def refuse():
    raise ValueError("m.pt: no model")


def die():
    os._exit(3)


def draw(job):
    """killed: dies once; doomed: each time; hang: for ever; fat: takes 300 MB; other: drawn."""
    name = Path(job.shape).stem.rstrip("0123456789")
    mark = Path(job.output + ".mark")
    if name == "doomed" or (name == "killed" and not mark.exists()):
        mark.write_text("")
        replace_file(job.output, lambda part: os.kill(os.getpid(), signal.SIGKILL))
    elif name == "hang":
        replace_file(job.output, lambda part: time.sleep(60))
    elif name == "fat":
        taken = bytearray(os.urandom(1)) * 300_000_000
        time.sleep(60)
        return len(taken)
    Path(job.output).write_text(job.shape)
    return Outcome(job.shape, job.output, files=(job.output,))

"""How much memory a process has resident: of its own, and of another; and how much there is."""

from __future__ import annotations

import contextlib
import ctypes
import os
import subprocess
import sys

MB = 2**20
_PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


def can_be_watched() -> bool:
    """Whether this system tells the memory of another process: Linux and macOS do."""
    return resident(os.getpid()) is not None


def installed() -> int | None:
    """Bytes of memory that this machine has; None where nobody tells."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * _PAGE
    except (AttributeError, ValueError, OSError):  # Windows; a system that does not know the name
        return None


def resident(process: int) -> int | None:
    """Bytes of memory that a process has resident; None where it is no more, or nobody tells."""
    try:
        if sys.platform == "linux":
            with open(f"/proc/{process}/statm", "rb") as file:
                return int(file.read().split()[1]) * _PAGE
        return _told_by_ps(process)
    except (OSError, ValueError, IndexError, subprocess.SubprocessError):
        return None


def _told_by_ps(process: int) -> int | None:
    if os.name == "nt":
        return None
    command = ["ps", "-o", "rss=", "-p", str(process)]
    told = subprocess.run(command, capture_output=True, timeout=5, check=True).stdout
    return int(told) * 1024


def give_back() -> None:
    """Give freed memory back to the system, where its allocator would keep it (glibc).

    Else a worker keeps what its largest shapes took, in pieces, and grows over hundreds of them.
    It takes some milliseconds.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library
            ctypes.CDLL(None).malloc_trim(0)


def forget_peak() -> None:
    """From now on `peak` tells what is to come; only Linux can."""
    with contextlib.suppress(OSError), open("/proc/self/clear_refs", "w") as file:
        file.write("5")


def peak() -> float | None:
    """The most memory, MB, that this process had resident since it began or `forget_peak`."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        with open("/proc/self/status") as file:
            for line in file:
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) / 1024
    try:
        import resource
    except ImportError:  # Windows
        return None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / MB if sys.platform == "darwin" else most / 1024

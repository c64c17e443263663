"""What holds for all tests: how torch's threads wait, the browsers that pages are tried in, and
that no skipped test goes unnoticed."""

import os
from collections import Counter

import pytest

WORKERS = os.environ.get("PYTEST_XDIST_WORKER_COUNT")
if WORKERS:  # each has its share of the cores: two threads for each would wait for one another
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, (os.cpu_count() or 1) // int(WORKERS))))

# says how torch's threads wait, before anything imports torch; `render` gives the reason
import strokestyle.render  # noqa: E402, F401

STRICT = "STROKESTYLE_STRICT_SKIPS"  # where this is set, a skip for any other reason fails the run
ALLOWED_SKIPS = (
    "STROKESTYLE_SHARED is not set",
    "no CUDA device",
    "no program: ",
    "no browser: ",
    "no weights: ",
)


@pytest.fixture(scope="module")
def browsers():
    """The browsers of a module's tests, each started when it is first wanted."""
    from browsers import Browsers

    with Browsers() as running:
        yield running


@pytest.fixture
def browser(browsers, request):
    """The browser that a test is run in, as `in_both_browsers` says; else Chromium."""
    return browsers.get(getattr(request, "param", "chromium"))


def skip_reasons(config):
    """Count the tests, or modules of tests, that were skipped, by their reason."""
    reports = config.pluginmanager.get_plugin("terminalreporter").stats.get("skipped", [])
    return Counter(report.longrepr[2].removeprefix("Skipped: ") for report in reports)


def refused_skips(config):
    """The reasons that the run must not pass with."""
    if not os.environ.get(STRICT):
        return []
    return [reason for reason in skip_reasons(config) if not reason.startswith(ALLOWED_SKIPS)]


def pytest_sessionfinish(session):
    if hasattr(session.config, "workerinput"):  # a worker: whom it reports to counts all skips
        return
    if refused_skips(session.config) and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(hookwrapper=True, tryfirst=True)  # after the failures, next to pytest's last line
def pytest_terminal_summary(terminalreporter, config):
    yield
    for reason, count in skip_reasons(config).most_common():
        terminalreporter.write_line(f"skipped {count}: {reason}")
    for reason in refused_skips(config):
        terminalreporter.write_line(f"failed: {STRICT} is set, and does not allow: {reason}")

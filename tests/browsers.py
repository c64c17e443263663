"""The browsers that pages are tried in, each started once for a module's tests."""

import pytest
from browser import NO_BROWSER, Browser
from firefox import NO_FIREFOX, Firefox

KINDS = {"chromium": (Browser, NO_BROWSER), "firefox": (Firefox, NO_FIREFOX)}
in_browser = pytest.mark.skipif(NO_BROWSER is not None, reason=NO_BROWSER or "")
# marks a test that is run in both; others are run in chromium
in_both_browsers = pytest.mark.parametrize("browser", list(KINDS), indirect=True)


class Browsers:
    """The browsers started so far. Used as a context."""

    def __enter__(self):
        self.running = {}
        return self

    def __exit__(self, *error):
        for browser in self.running.values():
            browser.__exit__(None, None, None)

    def get(self, kind: str):
        """The browser of a kind; the test is skipped where there is none that starts."""
        make, reason = KINDS[kind]
        if reason:
            pytest.skip(reason)
        if kind not in self.running:
            try:
                self.running[kind] = make().__enter__()
            # a sandbox may hold a browser that cannot run in it
            except (OSError, RuntimeError, TimeoutError) as error:
                pytest.skip(f"no browser: {kind} is there, but does not start ({error})")
        return self.running[kind]

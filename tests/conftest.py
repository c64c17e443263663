"""Says how torch's threads wait, before anything imports torch; `render` gives the reason."""

import strokestyle.render  # noqa: F401

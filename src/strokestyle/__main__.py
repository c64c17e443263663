"""`python -m strokestyle`: the command line."""

from .cli import main

main(prog_name="strokestyle")

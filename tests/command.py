"""The command line in process, as a user calls it."""

from click.testing import CliRunner

from strokestyle import cli


def run(*args, cwd=None):
    """Run a command in process; tracebacks of unexpected exceptions are raised here."""
    result = CliRunner().invoke(cli.main, [str(a) for a in args])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def refused(*args, words=(), code=1):
    """The command fails with one line on stderr that holds all `words`."""
    result = run(*args)
    assert result.exit_code == code, result.output
    if code == 1:
        lines = result.stderr.strip().splitlines()
        assert len(lines) == 1 and lines[0].startswith("strokestyle: "), result.stderr
    for word in words:
        assert word in result.stderr, result.stderr
    assert result.stdout == ""
    return result.stderr

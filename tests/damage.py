"""Files that something went wrong with."""

import re
import warnings

STRANGE = [b"-1", b"99999999999999999999", b"1e400", b"nan", b"", b"a", b"3", b"0", b"\xff", b"<"]


def damaged(data, rng):
    """Change bytes of a text: numbers, pieces lost, doubled or overwritten."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        at, size = int(rng.integers(len(data))), int(rng.integers(1, 40))
        kind = rng.integers(4)
        if kind == 0:
            del data[at : at + size]
        elif kind == 1:
            data[at:at] = data[at // 2 : at // 2 + size]
        elif kind == 2:
            data[at] = b"0123456789-.<>/#x \x00\xff"[rng.integers(20)]
        else:
            numbers = list(re.finditer(rb"\d+", bytes(data)))
            one = numbers[rng.integers(len(numbers))]
            data[one.start() : one.end()] = STRANGE[rng.integers(len(STRANGE))]
    return bytes(data)


def is_read_or_refused(read, path):
    """Whether it is read; where it is refused, that is one line that names the file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = read(path)
        except (ValueError, OSError) as error:
            assert str(error).startswith(str(path)) and "\n" not in str(error)
            return False
    assert found.faces.max() < len(found.vertices)
    return True

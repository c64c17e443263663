"""ICC profiles made by hand: what each colour space says of itself, and no more (ICC.1:2001-04)."""

import struct

import numpy as np

# XYZ of red, green and blue under D50, the columns of a profile
P3 = [[0.51512, 0.24120, -0.00105], [0.29198, 0.69225, 0.04189], [0.15710, 0.06657, 0.78407]]
ADOBE = [[0.60974, 0.31111, 0.01947], [0.20528, 0.62567, 0.06087], [0.14919, 0.06322, 0.74457]]
SRGB = [[0.43607, 0.22249, 0.01392], [0.38515, 0.71687, 0.09708], [0.14307, 0.06061, 0.71410]]
D50 = [0.9642, 1.0, 0.8249]


def srgb_curve(x):
    """Coded value -> light."""
    x = np.asarray(x, float)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def curve(law):
    """A curv tag: a gamma, or 1024 samples of a function."""
    if isinstance(law, (int, float)):
        return b"curv\0\0\0\0" + struct.pack(">IH", 1, round(law * 256))
    samples = np.round(law(np.linspace(0, 1, 1024)) * 65535).astype(">u2")
    return b"curv\0\0\0\0" + struct.pack(">I", len(samples)) + samples.tobytes()


def xyz(values):
    return b"XYZ \0\0\0\0" + np.round(np.array(values) * 65536).astype(">i4").tobytes()


def profile(law, colorants=None):
    """A display's profile of one curve: RGB with these colorants, or grey."""
    text = b"desc\0\0\0\0" + struct.pack(">I", 5) + b"test\0" + bytes(78)
    tags = [(b"desc", text), (b"cprt", b"text\0\0\0\0none\0"), (b"wtpt", xyz(D50))]
    if colorants is None:
        tags.append((b"kTRC", curve(law)))
    else:
        tags += [
            (name + b"XYZ", xyz(c)) for name, c in zip((b"r", b"g", b"b"), colorants, strict=True)
        ]
        tags += [(name + b"TRC", curve(law)) for name in (b"r", b"g", b"b")]
    table, data = struct.pack(">I", len(tags)), b""
    start = 128 + 4 + 12 * len(tags)
    for name, body in tags:
        table += name + struct.pack(">II", start + len(data), len(body))
        data += body + bytes(-len(body) % 4)
    head = struct.pack(
        ">I4sI4s4s4s12s4s", start + len(data), b"none", 0x02400000, b"mntr",
        b"RGB " if colorants else b"GRAY", b"XYZ ",
        struct.pack(">6H", 2020, 1, 1, 0, 0, 0), b"acsp",
    )  # fmt: skip
    head += bytes(28) + np.round(np.array(D50) * 65536).astype(">i4").tobytes() + bytes(48)
    return head + table + data


def as_srgb(rgb, law, colorants):
    """What a profile's RGB (..., 3) is in sRGB: the closed form."""
    light = np.asarray(rgb, float) ** law if isinstance(law, (int, float)) else law(rgb)
    to_srgb = np.linalg.inv(np.array(SRGB).T) @ np.array(colorants).T
    light = (light @ to_srgb.T).clip(0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)

"""TIFF files made by hand: every layout of samples, uncompressed or with deflate (TIFF 6.0)."""

import struct
import zlib

import numpy as np

CODES = {np.dtype(np.uint16): "H", np.dtype(np.uint32): "I", np.dtype(np.uint8): "B"}


def tiff(samples, photometric, *, order="<", extra=(), separate=False, tile=0, deflate=False,
         predictor=1, bits=None, tags=None, rows=40):  # fmt: skip
    """The bytes of a TIFF of samples (h, w, n) of any dtype; `bits` packs integers closer."""
    height, width, n = samples.shape
    dtype = samples.dtype.newbyteorder(order)
    planes = [samples[..., k : k + 1] for k in range(n)] if separate else [samples]
    step = (tile, tile) if tile else (rows, width)
    blocks = []
    for plane in planes:
        for y in range(0, height, step[0]):
            for x in range(0, width, step[1]):
                block = plane[y : y + step[0], x : x + step[1]]
                if tile:
                    h, w = block.shape[:2]
                    block = np.pad(block, ((0, tile - h), (0, tile - w), (0, 0)))
                data = _bytes(block, dtype, predictor, bits)
                blocks.append(zlib.compress(data) if deflate else data)
    starts = (8 + np.cumsum([0, *map(len, blocks)])[:-1]).tolist()
    form = 3 if samples.dtype.kind == "f" else 2 if samples.dtype.kind == "i" else 1
    entries = {
        256: [width], 257: [height], 258: [bits or samples.dtype.itemsize * 8] * n,
        259: [8 if deflate else 1], 262: [photometric], 277: [n], 284: [2 if separate else 1],
        317: [predictor], 339: [form] * n,
    }  # fmt: skip
    sizes = [len(block) for block in blocks]
    if tile:
        entries |= {322: [tile], 323: [tile], 324: starts, 325: sizes}
    else:
        entries |= {273: starts, 278: [rows], 279: sizes}
    if extra:
        entries[338] = list(extra)
    return _file(b"".join(blocks), entries | (tags or {}), order)


def _bytes(block, dtype, predictor, bits):
    if bits:
        places = (block.reshape(len(block), -1, 1) >> np.arange(bits - 1, -1, -1)) & 1
        return np.packbits(places.reshape(len(block), -1).astype(np.uint8), axis=1).tobytes()
    if predictor == 2:
        block = np.diff(block, axis=1, prepend=np.zeros_like(block[:, :1]))
    if predictor == 3:
        h, w, n = block.shape
        parts = block.astype(dtype.newbyteorder(">")).reshape(h, -1).view(np.uint8)
        turned = parts.reshape(h, w * n, -1).swapaxes(1, 2).reshape(h, -1, n)
        return np.diff(turned, axis=1, prepend=np.zeros_like(turned[:, :1])).tobytes()
    return block.astype(dtype).tobytes()


def _file(body, entries, order):
    body += bytes(len(body) % 2)
    after = 8 + len(body) + 2 + 12 * len(entries) + 4
    table, tail = b"", b""
    for tag, values in sorted(entries.items()):
        kind, code, length = (7, "B", 1) if isinstance(values, bytes) else (4, "I", 4)
        packed = struct.pack(f"{order}{len(values)}{code}", *values)
        if len(packed) > 4:
            tail += packed
            packed = struct.pack(order + "I", after + len(tail) - len(packed))
        table += struct.pack(order + "HHI", tag, kind, len(values)) + packed.ljust(4, b"\0")
    head = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, 8 + len(body))
    return head + body + struct.pack(order + "H", len(entries)) + table + bytes(4) + tail

"""Files of painting programs made by hand: .kra, .ora and .psd with layers."""

import io
import struct
import zipfile
import zlib
from xml.sax.saxutils import quoteattr

import numpy as np
from PIL import Image


def png(array):
    out = io.BytesIO()
    Image.fromarray(array).save(out, "PNG")
    return out.getvalue()


def zipped(entries):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return out.getvalue()


def ora(size, layers, merged):
    """OpenRaster of layers (name, RGBA array, x, y), topmost first; two in a stack."""
    text = [
        f"<layer name={quoteattr(name)} src='data/{k}.png' x='{x}' y='{y}'/>"
        for k, (name, _, x, y) in enumerate(layers)
    ]
    stack = f"<stack><stack name='group'>{''.join(text[:2])}</stack>{''.join(text[2:])}</stack>"
    entries = {
        "mimetype": b"image/openraster",
        "stack.xml": f"<?xml version='1.0'?><image w='{size[0]}' h='{size[1]}'>{stack}</image>",
        "mergedimage.png": png(merged),
    }
    return zipped(entries | {f"data/{k}.png": png(one[1]) for k, one in enumerate(layers)})


def lzf(data):
    """Pack bytes: runs of one byte as a repetition of the byte before, all else as it is."""
    out, plain, k = bytearray(), bytearray(), 0

    def flush():
        for start in range(0, len(plain), 32):
            part = plain[start : start + 32]
            out.extend([len(part) - 1, *part])
        plain.clear()

    while k < len(data):
        run = 1
        while k + run < len(data) and data[k + run] == data[k] and run < 265:
            run += 1
        plain.append(data[k])
        if run >= 10:
            flush()
            out.extend([7 << 5, run - 1 - 2 - 7, 0])
            k += run
        else:
            k += 1
    flush()
    return bytes(out)


def tiles(pixels, packed=True, step=64):
    """The tiles of a Krita layer: pixels (h, w, n) in the order of its memory."""
    h, w, n = pixels.shape
    size = n * pixels.dtype.itemsize
    whole = np.zeros((-(-h // step) * step, -(-w // step) * step, n), pixels.dtype)
    whole[:h, :w] = pixels
    parts = []
    for y in range(0, h, step):
        for x in range(0, w, step):
            plain = np.ascontiguousarray(whole[y : y + step, x : x + step]).tobytes()
            planes = np.frombuffer(plain, np.uint8).reshape(-1, size).T.tobytes()
            data = b"\1" + lzf(planes) if packed else b"\0" + plain
            parts.append(f"{x},{y},LZF,{len(data)}\n".encode() + data)
    head = f"VERSION 2\nTILEWIDTH {step}\nTILEHEIGHT {step}\nPIXELSIZE {size}\nDATA {len(parts)}\n"
    return head.encode() + b"".join(parts)


def kra(size, layers, merged, space="RGBA", packed=True, profile=b""):
    """Krita's file of layers (name, pixels in the order of its memory, x, y)."""
    text = "".join(
        f"<layer name={quoteattr(name)} nodetype='paintlayer' x='{x}' y='{y}' "
        f"colorspacename='{space}' filename='layer{k}'/>"
        for k, (name, _, x, y) in enumerate(layers)
    )
    document = (
        "<!DOCTYPE DOC PUBLIC '-//KDE//DTD krita 2.0//EN' 'http://www.calligra.org/DTD/krita.dtd'>"
        f"<DOC xmlns='http://www.calligra.org/DTD/krita'><IMAGE name='my drawing' "
        f"width='{size[0]}' height='{size[1]}'><layers><layer nodetype='grouplayer' name='group'>"
        f"<layers>{text}</layers></layer></layers></IMAGE></DOC>"
    )
    entries = {"mimetype": b"application/x-krita", "maindoc.xml": document}
    if merged is not None:
        entries["mergedimage.png"] = png(merged)
    for k, (_, pixels, _, _) in enumerate(layers):
        entries[f"my drawing/layers/layer{k}"] = tiles(pixels, packed)
        entries[f"my drawing/layers/layer{k}.defaultpixel"] = bytes(pixels[0, 0].nbytes)
        if profile:
            entries[f"my drawing/layers/layer{k}.icc"] = profile
    return zipped(entries)


def packbits(row):
    """A row as literals and repetitions."""
    out, k = bytearray(), 0
    while k < len(row):
        run = 1
        while k + run < len(row) and row[k + run] == row[k] and run < 128:
            run += 1
        out += bytes([257 - run, row[k]]) if run > 1 else bytes([0, row[k]])
        k += run
    return bytes(out)


def _channel(plane, packed, wide):
    """A channel's data, method first: (counts of rows, bytes)."""
    plane = plane.astype(plane.dtype.newbyteorder(">"))
    if packed == 1:
        rows = [packbits(row.tobytes()) for row in plane]
        return struct.pack(f">{len(rows)}{'I' if wide else 'H'}", *map(len, rows)), b"".join(rows)
    if packed == 3:
        native = plane.astype(plane.dtype.newbyteorder("="))
        plane = np.diff(native, axis=1, prepend=np.zeros_like(native[:, :1]))
        plane = plane.astype(plane.dtype.newbyteorder(">"))
    data = plane.tobytes()
    return b"", zlib.compress(data) if packed else data


def psd(size, layers, merged, mode=3, wide=False, packed=1, resources=b"", alpha=False):
    """Photoshop's file of layers (name, samples (h, w, n + 1) with opacity, x, y, more).

    `merged` : (h, w, n), and one more with `alpha`; the topmost layer first; `more` a mask (h, w)
    """
    size_code = ">Q" if wide else ">I"
    records, data = b"", b""
    for name, samples, x, y, mask in reversed(layers):
        h, w, n = samples.shape
        planes = {k if k < n - 1 else -1: samples[..., k] for k in range(n)}
        extra = struct.pack(">I", 0)
        if mask is not None:
            planes[-2] = mask
            extra = struct.pack(">I4iBBH", 20, y, x, y + h, x + w, 0, 0, 0)
        short = name.encode("ascii", "replace")[:200]
        short = bytes([len(short)]) + short
        letters = name.encode("utf-16-be")
        unicode = struct.pack(">I", len(letters) // 2) + letters
        unicode += bytes(-len(unicode) % 4)
        extra += struct.pack(">I", 0) + short + bytes(-len(short) % 4)
        extra += b"8BIMluni" + struct.pack(">I", len(unicode)) + unicode
        records += struct.pack(">4iH", y, x, y + h, x + w, len(planes))
        for number, plane in planes.items():
            body = struct.pack(">H", packed) + b"".join(_channel(plane, packed, wide))
            records += struct.pack(">h", number) + struct.pack(size_code, len(body))
            data += body
        records += b"8BIMnorm" + bytes([255, 0, 0, 0]) + struct.pack(">I", len(extra)) + extra
    count = -len(layers) if alpha else len(layers)
    info = struct.pack(">h", count) + records + data
    info += bytes(-len(info) % 4)
    block = struct.pack(size_code, len(info)) + info + bytes(4) if layers else b""
    depth, channels = merged.dtype.itemsize * 8, merged.shape[2]
    head = struct.pack(
        ">4sH6sHIIHH", b"8BPS", 2 if wide else 1, bytes(6), channels, size[1], size[0], depth, mode
    )
    if packed == 1:
        parts = [_channel(merged[..., k], 1, wide) for k in range(channels)]
        body = struct.pack(">H", 1) + b"".join(a for a, _ in parts) + b"".join(b for _, b in parts)
    else:
        body = struct.pack(">H", 0)
        body += b"".join(_channel(merged[..., k], 0, wide)[1] for k in range(channels))
    resources = struct.pack(">I", len(resources)) + resources
    return head + bytes(4) + resources + struct.pack(size_code, len(block)) + block + body


def resource(number, data):
    """A block of image resources."""
    return b"8BIM" + struct.pack(">HHI", number, 0, len(data)) + data + bytes(len(data) % 2)

"""Damaged and hostile SVG files against the reader: each is read, or refused in one line, within
seconds, and nothing but the file itself is touched. Prints a table.

    python benchmarks/fuzz_svg.py [count]
"""

import base64
import builtins
import collections
import gzip
import resource
import socket
import struct
import sys
import time
import zlib

import numpy as np

from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.geometry.parts import Parts
from strokestyle.svg.read import read_svg
from strokestyle.svg.write import write_svg

NUMBERS = (
    "nan",
    "inf",
    "-inf",
    "1e999",
    "-1",
    "1e308",
    "0",
    "",
    "1e-320",
    "9" * 400,
    "1,",
    ",",
    "0x10",
    "1e5",
    "٣",
)
ATTRIBUTES = (
    "data-ss-path", "data-ss-width", "data-ss-class", "data-ss-closed", "data-ss-texture",
    "data-ss-margin", "data-ss-at", "data-ss-size", "data-ss-page", "data-ss-options",
    "data-ss-format", "data-ss-part", "data-ss-parts",
    "viewBox", "width", "height", "transform", "fill", "fill-opacity", "d", "id", "style",
)  # fmt: skip


def sample(texture: bool) -> str:
    """A small file of ours, with an open and a closed stroke."""
    t = np.linspace(0, 1, 12)
    line = np.stack([10 + 80 * t, 30 + 8 * np.sin(6 * t)], axis=1)
    ring = np.stack([50 + 20 * np.cos(2 * np.pi * t), 60 + 15 * np.sin(2 * np.pi * t)], axis=1)
    ring[-1] = ring[0]
    strokes = Strokes(
        np.concatenate([line, ring]),
        np.r_[1 + 3 * t, 2 + 0 * t],
        [0, 12, 24],
        [0, 5],
        [False, True],
    )
    strips = None
    if texture:
        rgba = np.random.default_rng(0).integers(0, 256, (100, 8, 4)).astype(np.uint8)
        rgba[..., :3] = [20, 30, 40]
        strips = Texture(rgba, [0, 50, 100], 1.0)
    color = np.tile(np.array([20, 30, 40, 200]) / 255, (2, 1))
    return write_svg(
        Drawing(strokes, (100, 90), color, strips, Parts(("a & b", "\u65e5"), [1, 0])), title="fuzz"
    )


def png(width: int, height: int, body: bytes, bits: int = 4) -> bytes:
    parts = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, bits, 0, 0, 0, 0)),
        (b"IDAT", body),
        (b"IEND", b""),
    ]
    chunks = (
        struct.pack(">I", len(b)) + n + b + struct.pack(">I", zlib.crc32(n + b)) for n, b in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


HEAVY = (
    "images of many",
    "huge tone",
    "high tone",
    "tones of many",
    "many points",
    "many elements",
    "many strokes",
    "huge attribute",
    "svgz bomb",
    "texture bomb",
)


def hostile(rng: np.random.Generator, text: str, without=()) -> tuple[str, bytes]:
    """(what it is, a file made to do harm)."""

    def strip(data):
        return with_value(text, "data-ss-texture", base64.b64encode(data).decode()).encode()

    def inside(markup):
        return text.replace("</svg>", markup + "</svg>").encode()

    def drawn(inside):  # a stroke whose texture is what is drawn in it
        where = 'data-ss-path="M0 0l90 0" data-ss-width="20" data-ss-margin="2"'
        return f"<g {where}>{inside}</g>"

    def image(data):
        return f'<image width="90" height="24" xlink:href="data:image/png;base64,{data}"/>'

    large = base64.b64encode(png(2_000, 900, zlib.compress(bytes(901_000)))).decode()
    bomb = "".join(f'<!ENTITY b{i} "{f"&b{i - 1};" * 10}">' for i in range(1, 9))
    head = text[text.index("<svg") :]
    cases = {
        "entity bomb": lambda: (
            f'<!DOCTYPE svg [<!ENTITY b0 "x">{bomb}]>' + head.replace("fuzz", "&b8;")
        ).encode(),
        "external entity": lambda: (
            '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + head.replace("fuzz", "&x;")
        ).encode(),
        "external document type": lambda: (
            '<!DOCTYPE svg SYSTEM "http://127.0.0.1:9/x.dtd">' + head
        ).encode(),
        "network references": lambda: inside(
            '<image xlink:href="http://127.0.0.1:9/a.png"/><use xlink:href="file:///etc/passwd#a"/>'
            "<style>@import url(http://127.0.0.1:9/a.css);</style>"
            '<script xlink:href="http://127.0.0.1:9/a.js"/>'
        ),
        "huge attribute": lambda: with_value(
            text, str(rng.choice(ATTRIBUTES)), "1 " * 4_000_000
        ).encode(),
        "many elements": lambda: inside("<g/>" * 300_000),
        "many strokes": lambda: inside(
            '<path data-ss-path="M0 0l1 1" data-ss-width="1 1"/>' * 60_000
        ),
        "deep": lambda: inside("<g>" * 5_000 + "</g>" * 5_000),
        "many points": lambda: with_value(
            text, "data-ss-path", "M0 0l" + "1 1 " * 900_000
        ).encode(),
        "many transforms": lambda: inside(
            '<g transform="scale(1e9)">' * 200 + '<path data-ss-path="M0 0l1 1"/>' + "</g>" * 200
        ),
        "texture bomb": lambda: strip(png(60_000, 60_000, zlib.compress(bytes(20_000_000)))),
        "texture bomb within limits": lambda: strip(
            png(2_000, 900, zlib.compress(bytes(20_000_000)))
        ),
        "texture too short": lambda: strip(png(500, 30, zlib.compress(b"abc"))),
        "textures of many": lambda: inside(
            f'<path data-ss-path="M0 0l9 9" data-ss-texture="{large}"/>' * 40
        ),
        "image bomb": lambda: inside(
            drawn(image(base64.b64encode(png(60_000, 60_000, b"")).decode()))
        ),
        "images of many": lambda: inside(drawn(image(large)) * 40),
        "many images": lambda: inside(drawn(image(large) * 40)),
        "image elsewhere": lambda: inside(
            drawn('<image width="9" height="9" xlink:href="http://127.0.0.1:9/a.png"/>')
        ),
        "huge tone": lambda: inside(drawn(f'<path d="M0 0{"q9 9 9-9t-9 9 9-9-9 1z" * 200_000}"/>')),
        "high tone": lambda: inside(
            drawn(f'<path d="M0-9{"q9 9 0 20t9-20 0 20-9-20z" * 40_000}"/>')
        ),
        "tones of many": lambda: inside(
            drawn('<path transform="scale(9)" d="M0 0q9 9 9-9t-9 9 9-9z"/>') * 15_000
        ),
        "wide stroke of tones": lambda: inside(
            drawn('<path d="M0 0h9v9z"/>').replace('"20"', '"90000"')
        ),
        "clones of clones": lambda: inside(
            "<defs><g id='k0'><use xlink:href='#s000'/></g>"
            + "".join(
                f"<g id='k{k + 1}'><use href='#k{k}'/><use href='#k{k}'/></g>" for k in range(40)
            )
            + "</defs><use href='#k40'/>"
        ),
        "clone of itself": lambda: inside("<g id='k'><use href='#s000'/><use href='#k'/></g>"),
        "selectors of many parts": lambda: inside(
            f"<style>{('g ' * 20 + '.x{fill:red}') * 100}</style>{'<g>' * 200}{'</g>' * 200}"
        ),
        "stray braces": lambda: inside(f"<style>{'{@/*[' * 200_000}</style>"),
        "svgz bomb": lambda: gzip.compress(text.encode() + b" " * 200_000_000, 1),
        "svgz cut": lambda: gzip.compress(text.encode())[:-9],
        "utf-16": lambda: text.replace("utf-8", "utf-16").encode("utf-16"),
        "other encoding": lambda: text.replace("utf-8", "x-none").encode(),
        "not svg": lambda: (
            b"<html><body>"
            + bytes(rng.integers(32, 127, 2000).astype(np.uint8))
            + b"</body></html>"
        ),
        "noise": lambda: bytes(rng.integers(0, 256, 5000).astype(np.uint8)),
        "newer": lambda: with_value(text, "data-ss-format", "99").encode(),
        "empty": lambda: b"",
    }
    name = str(rng.choice([name for name in sorted(cases) if name not in without]))
    return name, cases[name]()


def with_value(text: str, attribute: str, value: str) -> str:
    """The text with another value for the first such attribute; added to the first stroke where
    there is none."""
    begin = text.find(f' {attribute}="')
    if begin < 0:
        return text.replace(' class="stroke"', f' class="stroke" {attribute}="{value}"', 1)
    first = begin + len(attribute) + 3
    return text[:first] + value + text[text.index('"', first) :]


def damaged(rng: np.random.Generator, text: str) -> tuple[str, bytes]:
    """(what it is, a file of ours that came to harm)."""
    name = str(
        rng.choice(
            [
                "bytes",
                "cut",
                "piece lost",
                "piece twice",
                "number",
                "numbers",
                "attribute lost",
                "text",
            ]
        )
    )
    data = bytearray(text.encode())
    if name == "bytes":
        for at in rng.integers(0, len(data), rng.integers(1, 30)):
            data[at] = rng.integers(0, 256) if rng.random() < 0.3 else rng.integers(32, 127)
        return name, bytes(data)
    a, b = np.sort(rng.integers(0, len(data), 2)).tolist()
    if name == "cut":
        return name, bytes(data[:a])
    if name == "piece lost":
        return name, bytes(data[:a] + data[min(b, a + 300) :])
    if name == "piece twice":
        return name, bytes(data[: min(b, a + 2000)] + data[a:])
    if name == "attribute lost":
        attribute = str(rng.choice(ATTRIBUTES))
        return name, text.replace(f" {attribute}=", " data-x=").encode()
    if name == "text":
        words = "".join(rng.choice(list("aM1. -&;'é("), 20))
        return name, with_value(text, str(rng.choice(ATTRIBUTES)), words).encode()
    for _ in range(1 if name == "number" else 6):
        attribute, value = str(rng.choice(ATTRIBUTES)), str(rng.choice(NUMBERS))
        begin = text.find(f' {attribute}="')
        if begin < 0:
            text = with_value(text, attribute, value)
            continue
        first = begin + len(attribute) + 3
        parts = text[first : text.index('"', first)].split(" ")
        parts[rng.integers(len(parts))] = value
        text = with_value(text, attribute, " ".join(parts))
    return name, text.encode("utf-8")


class Guard:
    """While it is entered, opening a file or a socket is an error."""

    def __enter__(self):
        self.open, self.socket = builtins.open, socket.socket.connect

        def refuse(*args, **kwargs):
            raise AssertionError(f"the reader reached out: {args}")

        builtins.open, socket.socket.connect = refuse, refuse

    def __exit__(self, *error):
        builtins.open, socket.socket.connect = self.open, self.socket


def attempt(data: bytes) -> tuple[str, float]:
    """("read", "read and written" or the refusal, seconds). Raises whatever is not a refusal in
    one line."""
    start = time.perf_counter()
    with Guard():
        try:
            drawing = read_svg(data)
        except ValueError as error:
            message = str(error)
            assert message and "\n" not in message and len(message) < 400, message
            return message, time.perf_counter() - start
    seconds = time.perf_counter() - start
    if len(drawing.strokes.xy) < 2000 and drawing.strokes.thickness.max(initial=0) < 1000:
        assert isinstance(write_svg(drawing, texture="none"), str)
        return "read and written", seconds
    return "read", seconds


def cases(count: int, seed: int = 0, without=()):
    """`count` random files: (what it is, bytes)."""
    texts = [sample(False), sample(True)]
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        text = texts[i // 4 % 2]
        yield hostile(rng, text, without) if i % 4 == 0 else damaged(rng, text)


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    table, slowest = collections.defaultdict(lambda: [0, 0, 0.0]), 0.0
    for name, data in cases(count):
        said, seconds = attempt(data)
        row = table[name]
        row[0] += 1
        row[1] += said.startswith("read")
        row[2] = max(row[2], seconds)
        slowest = max(slowest, seconds)
    print(f"{'file':28s} {'count':>6s} {'read':>6s} {'refused':>8s} {'slowest s':>10s}")
    for name, (total, good, worst) in sorted(table.items()):
        print(f"{name:28s} {total:6d} {good:6d} {total - good:8d} {worst:10.2f}")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{count} files, slowest {slowest:.2f} s, peak memory {memory:.0f} MB, no file or "
        f"network access"
    )


if __name__ == "__main__":
    main()

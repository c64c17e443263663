"""Photograph a drawing: what a phone, a table, a lamp and a sheet of paper do to it.

    python experiments/photograph.py DRAWING.png OUT [--kinds a,b] [--seed 0]
    python experiments/photograph.py SHARED OUT --styles a,b [--train spot] [--kinds a,b]

The first writes OUT/<kind>.jpg and, beside it, OUT/<kind>.json with the homography from the
drawing's pixels to the photograph's. The second writes the photographs of the training drawings as
OUT/<kind>/<style>/<train>/drawing.jpg, which `score_styles.py --drawings OUT/<kind>` learns from.
KINDS below says what there is."""

import argparse
import io
import json
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

KINDS = {
    "homography": dict(keystone=0.04),
    "homography8": dict(keystone=0.08),
    "photo": dict(
        keystone=0.02, turn=1.5, light=0.35, warm=1, shadow=0.25, grain=0.01, blur=0.6, jpeg=85
    ),
    "flash": dict(keystone=0.03, flash=0.5, light=-0.15, grain=0.01, blur=0.8, jpeg=80),
    "hand": dict(keystone=0.02, shadow=0.45, grain=0.008, blur=0.6, jpeg=85),
    "ruled": dict(keystone=0.02, ruling="ruled", light=0.2, grain=0.008, blur=0.5, jpeg=85),
    "squared": dict(keystone=0.01, turn=1.0, ruling="squared", grain=0.008, blur=0.5, jpeg=90),
    "pencil": dict(keystone=0.01, pencil=0.35, grain=0.008, blur=0.4, jpeg=90),
    "table": dict(table="dark", turn=12, keystone=0.05, light=0.3, grain=0.01, blur=0.6, jpeg=85),
    "wood": dict(table="wood", turn=-20, keystone=0.06, grain=0.01, blur=0.6, jpeg=85),
    "light": dict(table="light", turn=6, keystone=0.04, shadow=0.2, grain=0.01, blur=0.5, jpeg=88),
    "corner": dict(table="wood", turn=15, keystone=0.03, cut=0.07, grain=0.01, blur=0.5, jpeg=85),
    "coffee": dict(table="dark", turn=3, tint=(0.93, 0.83, 0.66), grain=0.02, blur=0.7, jpeg=75),
}
SIZE = 1400  # px, longer side of a photograph


def quad_homography(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) that takes four points (4, 2) to four others."""
    rows, right = [], []
    for (x, y), (u, v) in zip(source, target, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        right += [u, v]
    return np.append(np.linalg.solve(rows, right), 1.0).reshape(3, 3)


def warped(image: np.ndarray, back: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(h, w, K) -> (*shape, K); `back` takes pixels of the result to those of the image."""
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    u, v, w = np.einsum("ij,jyx->iyx", back, np.stack([x, y, np.ones_like(x)]))
    at = [v / w - 0.5, u / w - 0.5]
    planes = [
        ndimage.map_coordinates(image[..., k], at, order=3, mode="nearest")
        for k in range(image.shape[2])
    ]
    return np.stack(planes, axis=-1)


def ruling(shape: tuple[int, int], kind: str, rng) -> np.ndarray:
    """Opacity (H, W) of printed lines, 24 to 40 lines over the sheet, a little uneven."""
    side = max(shape)
    pitch = side / rng.uniform(24, 32) if kind == "ruled" else side / rng.uniform(34, 42)
    width = side / rng.uniform(500, 800)
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    out = np.zeros(shape)
    for at in (y,) if kind == "ruled" else (y, x):
        off = np.abs((at / pitch + rng.uniform(0, 1)) % 1 - 0.5) * pitch
        out = np.maximum(out, np.clip(width / 2 - off + 0.5, 0, 1))
    return out * rng.uniform(0.3, 0.45)


def pencilled(ink: np.ndarray, opacity: float, rng) -> np.ndarray:
    """Opacity (H, W) of a construction in pencil: the drawing's lines, thin and off, and axes."""
    core = ndimage.gaussian_filter(ink, 2.0) > 0.35
    depth = ndimage.distance_transform_edt(core)
    ridge = core & (depth >= ndimage.maximum_filter(depth, 3) - 1e-6)
    out = np.zeros(ink.shape)
    for _ in range(2):
        field = [ndimage.gaussian_filter(rng.normal(0, 1, ink.shape), 40) for _ in "xy"]
        field = [4.0 * f / np.abs(f).max() for f in field]
        y, x = np.nonzero(ridge)
        u = np.rint(x + field[0][y, x]).astype(int).clip(0, ink.shape[1] - 1)
        v = np.rint(y + field[1][y, x]).astype(int).clip(0, ink.shape[0] - 1)
        out[v, u] = 1
    h, w = ink.shape
    rows, cols = np.nonzero(core)
    for _ in range(3):
        angle = rng.uniform(0, np.pi)
        at = np.linspace(-0.45, 0.45, 2 * max(h, w))[:, None] * max(h, w)
        line = [cols.mean(), rows.mean()] + rng.normal(0, 40, 2)
        line = line + at * [np.cos(angle), np.sin(angle)]
        line = np.rint(line[(line > 1).all(1) & (line < [w - 2, h - 2]).all(1)]).astype(int)
        out[line[:, 1], line[:, 0]] = 1
    grain = 0.6 + 0.4 * ndimage.gaussian_filter(rng.normal(0, 1, ink.shape), 0.7)
    return opacity * np.clip(1.6 * ndimage.gaussian_filter(out, 0.6) * grain, 0, 1)


def table(shape: tuple[int, int], kind: str, rng) -> np.ndarray:
    """(H, W, 3) of a table's top."""
    y, x = np.mgrid[: shape[0], : shape[1]] / max(shape)
    noise = ndimage.gaussian_filter(rng.normal(0, 1, shape), 1.0) * 0.02
    if kind == "dark":
        return np.array([0.33, 0.26, 0.2]) * (1 + noise[..., None])
    if kind == "light":
        return np.array([0.8, 0.78, 0.76]) * (1 + 0.5 * noise[..., None])
    wave = x * 9 + 0.6 * np.sin(3 * y + 2 * x) + 0.15 * np.sin(17 * y)
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * wave) + 0.35 * np.sin(2 * np.pi * 5.3 * wave)
    boards = (np.abs((y * 5) % 1 - 0.5) > 0.485) * 0.25
    tone = 0.75 + 0.12 * rings - boards + noise
    return np.array([0.62, 0.43, 0.27]) * tone[..., None]


def lit(shape: tuple[int, int], rng, light: float, shadow: float, flash: float) -> np.ndarray:
    """Light (H, W): falling off by `light` to a side, a soft shadow, a spot of a flash."""
    y, x = np.mgrid[: shape[0], : shape[1]] / max(shape)
    angle = rng.uniform(0, 2 * np.pi)
    side = (x - 0.5) * np.cos(angle) + (y - 0.5) * np.sin(angle)
    out = 1 - abs(light) * np.clip(side + 0.5, 0, 1) ** 1.5
    if light < 0:
        out = 1 + light * 2.5 * np.clip(np.hypot(x - 0.5, y - 0.5) - 0.15, 0, 1)
    if shadow:
        angle = angle + rng.uniform(-1, 1)
        edge = (x - 0.5) * np.cos(angle) + (y - 0.5) * np.sin(angle) - 0.12
        edge = edge + 0.05 * np.sin(9 * (x + y) + rng.uniform(0, 6))
        soft = rng.uniform(0.012, 0.035)
        out = out * (1 - shadow / (1 + np.exp(-edge / soft)))
    if flash:
        at = rng.uniform(0.3, 0.7, 2)
        out = out * (1 + flash * np.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) / 0.03))
    return out


def corners(size: tuple[int, int], into: tuple[int, int], rng, **how) -> np.ndarray:
    """Where the four corners of a sheet of `size` (w, h) come to lie in a photograph (w, h)."""
    (w, h), fill = size, how.get("fill", 0.77 if how.get("table") else 1.0)
    xy = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    out = xy * [w, h] * fill * min(into[0] / w, into[1] / h)
    scale = max(np.ptp(out, axis=0))
    # a tilt, which every corner's shift is not: the far side becomes shorter
    tilt = rng.uniform(-1, 1, 2)
    tilt = how.get("keystone", 0.0) * tilt / np.abs(tilt).max()
    out = out / (1 + 2 * (xy * tilt).sum(axis=1, keepdims=True))
    c, s = np.cos(np.radians(how.get("turn", 0.0))), np.sin(np.radians(how.get("turn", 0.0)))
    out = out @ np.array([[c, -s], [s, c]]).T
    middle = 0.5 * np.array(into) + rng.uniform(-0.01, 0.01, 2) * scale
    if cut := how.get("cut"):
        # one corner leaves the picture
        far = (out + middle)[np.argmax(np.abs(out).sum(axis=1))]
        edge = np.where(far > 0.5 * np.array(into), into, 0)
        middle = middle + (edge - far) + np.sign(edge - 0.5 * np.array(into)) * cut * scale
    return out + middle


def photograph(drawing: np.ndarray, seed: int = 0, **how) -> tuple[np.ndarray, np.ndarray]:
    """Photograph a drawing (h, w, 3) in [0, 1].

    Returns the photograph (H, W, 3) uint8, and the matrix (3, 3) from the drawing to it, in pixels
    whose centres lie at +1/2.
    """
    rng = np.random.default_rng(seed)
    h, w = drawing.shape[:2]
    ink = 1 - drawing.min(axis=-1)
    sheet = drawing * np.array(how.get("tint", (0.97, 0.96, 0.93)))
    if how.get("ruling"):
        blue = 1 - ruling((h, w), how["ruling"], rng)[..., None] * (1 - np.array([0.5, 0.65, 0.9]))
        sheet = sheet * (1 - (1 - blue) * 1.6)
    if how.get("pencil"):
        sheet = sheet * (1 - pencilled(ink, how["pencil"], rng)[..., None])
    into = (SIZE, round(SIZE * h / w)) if w >= h else (round(SIZE * w / h), SIZE)
    if how.get("table"):
        into = (1080, 1400) if seed % 2 else (1400, 1080)
    source = np.array([[0, 0], [w, 0], [w, h], [0, h]], float)
    matrix = quad_homography(source, corners((w, h), into, rng, **how))
    shape = into[::-1]
    back = np.linalg.inv(matrix)
    photo = warped(sheet, back, shape)
    if how.get("table"):
        inside = warped(np.pad(np.ones((h - 2, w - 2, 1)), ((1, 1), (1, 1), (0, 0))), back, shape)
        fall = ndimage.gaussian_filter(inside[..., 0], 8.0)  # the sheet's own shadow on the table
        ground = table(shape, how["table"], rng) * (1 - 0.35 * fall[..., None])
        photo = inside * photo + (1 - inside) * ground
    light = lit(shape, rng, how.get("light", 0.0), how.get("shadow", 0.0), how.get("flash", 0.0))
    photo = photo * (0.92 * light)[..., None]
    if how.get("warm"):
        photo = photo * np.array([1.0, 0.93, 0.78])
    if blur := how.get("blur"):
        photo = ndimage.gaussian_filter(photo, (blur, blur, 0))
    grain = how.get("grain", 0.0)
    photo = photo + grain * ndimage.gaussian_filter(rng.normal(0, 1, shape), 0.6)[..., None]
    photo = (photo.clip(0, 1) * 255 + 0.5).astype(np.uint8)
    if quality := how.get("jpeg"):
        buffer = io.BytesIO()
        Image.fromarray(photo).save(buffer, "JPEG", quality=quality)
        photo = np.asarray(Image.open(buffer))
    return photo, matrix


def read(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), float) / 255.0


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("drawing", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--styles", help="comma-separated; DRAWING is then the shared folder")
    parser.add_argument("--train", default="spot")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    for kind in args.kinds.split(","):
        jobs = {args.drawing: args.out / kind}
        if args.styles:
            jobs = {
                args.drawing / "styles" / style / args.train / "drawing.png": args.out
                / kind
                / style
                / args.train
                / "drawing"
                for style in args.styles.split(",")
            }
        for source, target in jobs.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            photo, matrix = photograph(read(source), args.seed, **KINDS[kind])
            Image.fromarray(photo).save(f"{target}.jpg", quality=95, subsampling=0)
            Path(f"{target}.json").write_text(json.dumps(matrix.tolist()))
            print(f"{target}.jpg", flush=True)


if __name__ == "__main__":
    main()

"""Files of painting programs: the merged picture or one layer, or one line that says why not."""

import icc
import numpy as np
import painted_files as painted
import pytest

from strokestyle.fit.image_file import read_image
from strokestyle.fit.layered_file import unpack_lzf

SIZE = 150, 100
RNG = np.random.default_rng(5)
INK = np.zeros((70, 90, 4), np.uint8)
INK[20:30, 5:80] = [200, 40, 30, 255]
INK[40:60, 30:50, :3], INK[40:60, 30:50, 3] = [30, 60, 90], RNG.integers(1, 255, (20, 20))
NOTES = np.full((100, 150, 4), [0, 0, 255, 90], np.uint8)
MERGED = np.full((100, 150, 3), [240, 230, 210], np.uint8)
MERGED[50:60, 40:110] = [200, 40, 30]
LAYERS = [("Ink é", INK, 40, 50), ("Notes", NOTES, -20, -30), ("Notes", INK, 0, 0)]


def placed(layer, x, y):
    """A layer (h, w, 4) on the canvas."""
    whole = np.zeros((300, 400, 4), layer.dtype)
    whole[100 + y : 100 + y + layer.shape[0], 100 + x : 100 + x + layer.shape[1]] = layer
    return whole[100:200, 100:250]


def in_krita(layers, dtype=np.uint8, grey=False):
    """Layers in the order of Krita's memory: blue first, but of floats."""
    top = 255.0 if np.dtype(dtype).kind == "f" else 255.0 / np.iinfo(dtype).max
    order = [0, 3] if grey else [0, 1, 2, 3] if np.dtype(dtype).kind == "f" else [2, 1, 0, 3]
    return [(name, (array / top).astype(dtype)[..., order], x, y) for name, array, x, y in layers]


def files():
    yield "d.ora", painted.ora(SIZE, LAYERS, MERGED)
    yield "d.kra", painted.kra(SIZE, in_krita(LAYERS), MERGED)
    yield "plain.kra", painted.kra(SIZE, in_krita(LAYERS), MERGED, packed=False)
    yield "16.kra", painted.kra(SIZE, in_krita(LAYERS, np.uint16), MERGED, "RGBA16")
    yield "f.kra", painted.kra(SIZE, in_krita(LAYERS, np.float32), MERGED, "RGBAF32")
    with_masks = [(*one, None) for one in LAYERS]
    for packed in (0, 1, 2, 3):
        yield f"{packed}.psd", painted.psd(SIZE, with_masks, MERGED, packed=packed)
    yield "d.psb", painted.psd(SIZE, with_masks, MERGED, wide=True)


@pytest.mark.parametrize("name, data", list(files()), ids=lambda v: v if type(v) is str else "")
def test_the_merged_picture_or_a_layer(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    merged = read_image(path)
    assert merged.notes == () and not merged.transparent
    assert np.abs(merged.rgba[..., :3] - MERGED / 255.0).max() < 1e-6
    layer = read_image(path, layer="Ink é")
    assert layer.transparent and (layer.width, layer.height) == SIZE
    right = placed(INK, 40, 50) / 255.0
    assert np.abs(layer.rgba[..., 3] - right[..., 3]).max() < 1e-4
    assert (np.abs(layer.rgba - right)[..., :3] * right[..., 3:]).max() < 1e-3
    for wanted, words in (("Inks", "no layer is named"), ("Notes", "2 layers are named")):
        with pytest.raises(ValueError, match=words) as error:
            read_image(path, layer=wanted)
        assert "it has 'Ink é', 'Notes'" in str(error.value) and name in str(error.value)


def test_a_layer_beyond_the_canvas_is_cut_off(tmp_path):
    layers = [("Notes", NOTES, -20, -30), ("far", INK, 900, 0)]
    for name, data in (
        ("d.ora", painted.ora(SIZE, layers, MERGED)),
        ("d.kra", painted.kra(SIZE, in_krita(layers), MERGED)),
        ("d.psd", painted.psd(SIZE, [(*one, None) for one in layers], MERGED)),
    ):
        (tmp_path / name).write_bytes(data)
        found = read_image(tmp_path / name, layer="Notes").rgba
        assert np.abs(found[..., 3] - placed(NOTES, -20, -30)[..., 3] / 255.0).max() < 1e-6
        assert read_image(tmp_path / name, layer="far").rgba[..., 3].max() == 0


@pytest.mark.parametrize("dtype, space", [(np.uint8, "GRAYA"), (np.uint16, "GRAYA16")])
def test_greys_of_krita(tmp_path, dtype, space):
    layers = in_krita([("Ink", INK, 0, 0)], dtype, grey=True)
    (tmp_path / "d.kra").write_bytes(painted.kra(SIZE, layers, MERGED, space))
    found = read_image(tmp_path / "d.kra", layer="Ink").rgba
    right = placed(INK, 0, 0) / 255.0
    assert (np.abs(found[..., :3] - right[..., :1]) * right[..., 3:]).max() < 1e-3


def test_a_layers_profile(tmp_path):
    profile = icc.profile(icc.srgb_curve, icc.P3)
    layers = in_krita([("Ink", INK, 0, 0)])
    (tmp_path / "d.kra").write_bytes(painted.kra(SIZE, layers, MERGED, profile=profile))
    resources = painted.resource(1, b"odd") + painted.resource(1039, profile)
    (tmp_path / "d.psd").write_bytes(
        painted.psd(SIZE, [("Ink", INK, 0, 0, None)], MERGED, resources=resources)
    )
    right = icc.as_srgb(INK[25, 10, :3] / 255.0, icc.srgb_curve, icc.P3)
    for name in ("d.kra", "d.psd"):
        found = read_image(tmp_path / name, layer="Ink").rgba
        assert np.abs(found[25, 10, :3] - right).max() < 2.5 / 255


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("mode, n", [(1, 1), (3, 3), (4, 4)])
@pytest.mark.parametrize("packed", [0, 1])
def test_photoshops_kinds_of_colours(tmp_path, dtype, mode, n, packed):
    right = np.dstack([np.linspace(0.1, 0.9, 15000).reshape(100, 150) ** (k + 1) for k in range(n)])
    samples = right if mode != 4 else 1 - np.dstack([1 - right[..., :3], 0 * right[..., :1]])
    top = 1 if dtype is np.float32 else np.iinfo(dtype).max
    merged = (samples * top).astype(dtype)
    (tmp_path / "d.psd").write_bytes(painted.psd(SIZE, [], merged, mode, packed=packed))
    found = _quietly(tmp_path / "d.psd").rgba[..., :3]
    assert np.abs(found - right[..., : min(n, 3)]).max() < 1.6 / 255


@pytest.mark.filterwarnings("ignore:.*CMYK without")
def _quietly(path):
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read_image(path)


@pytest.mark.parametrize("matted", [False, True])
def test_a_merged_picture_with_opacity_straight_or_on_white(tmp_path, matted):
    right = placed(INK, 40, 20) / 255.0
    alpha = right[..., 3:]
    colours = right[..., :3] * alpha + 1 - alpha if matted else right[..., :3]
    merged = np.round(np.dstack([colours, alpha]) * 65535).astype(np.uint16)
    layers = [("Ink", merged, 0, 0, None)]
    (tmp_path / "d.psd").write_bytes(painted.psd(SIZE, layers, merged, alpha=True))
    found = read_image(tmp_path / "d.psd")
    assert found.transparent and np.abs(found.rgba[..., 3:] - alpha).max() < 1e-4
    assert (np.abs(found.rgba - right)[..., :3] * alpha).max() < 1e-3


def test_a_layers_mask_is_its_opacity(tmp_path):
    mask = np.zeros(INK.shape[:2], np.uint8)
    mask[:, :40] = 128
    data = painted.psd(SIZE, [("Ink", INK, 10, 20, mask)], MERGED)
    (tmp_path / "d.psd").write_bytes(data)
    found = read_image(tmp_path / "d.psd", layer="Ink").rgba[..., 3]
    masked = INK.copy()
    masked[..., 3] = (INK[..., 3] * (mask / 255.0)).astype(np.uint8)
    assert np.abs(found - placed(masked, 10, 20)[..., 3] / 255.0).max() < 1e-6


def test_lzf():
    """Tokens by hand: as is; a repetition that overlaps itself; a long one from far back."""
    assert unpack_lzf(bytes([2, 97, 98, 99]), 3) == b"abc"
    assert unpack_lzf(bytes([1, 97, 98, 3 << 5, 1]), 7) == b"abababa"
    far = bytes(range(32)) * 9
    packed = b"".join(bytes([31]) + far[k : k + 32] for k in range(0, 288, 32))
    assert unpack_lzf(packed + bytes([7 << 5 | 1, 20, 31]), 288 + 29) == far + far[:29]
    for broken in (b"", bytes([2, 97]), bytes([1 << 5, 0]), bytes([2, 97, 98, 99, 99])):
        with pytest.raises(ValueError, match="damaged"):
            unpack_lzf(broken, 3)


def refused():
    tiles = painted.tiles(in_krita(LAYERS)[0][1])
    head = tiles[: tiles.index(b"0,0,LZF")]
    good = {
        "maindoc.xml": b"<DOC><IMAGE name='a' width='40' height='40'><layers>"
        b"<layer name='Ink' filename='f'/></layers></IMAGE></DOC>",
        "a/layers/f": tiles,
    }
    for change, words in (
        ({}, "no layer is named 'Sketch'; it has 'Ink'"),
        ({"maindoc.xml": b"<DOC/>"}, "has no image"),
        ({"maindoc.xml": b"<DOC>"}, "damaged zip"),
        ({"maindoc.xml": b"<!DOCTYPE a [<!ENTITY b 'c'>]><DOC/>"}, "entities"),
        ({"maindoc.xml": b"<DOC>" + b"<a>" * 999 + b"</a>" * 999 + b"</DOC>"}, "too many layers"),
        ({"maindoc.xml": good["maindoc.xml"].replace(b"'40'", b"'x'")}, "no number"),
        ({"maindoc.xml": good["maindoc.xml"].replace(b"'40'", b"'1e9'")}, "is too large"),
    ):
        yield painted.zipped(good | change), "Sketch", words
    for change, words in (
        ({"a/layers/f": b""}, "damaged"),
        ({"a/layers/f": head}, "damaged"),
        ({"a/layers/f": tiles[:-9]}, "damaged"),
        ({"a/layers/f": tiles.replace(b"PIXELSIZE 4", b"PIXELSIZE 8")}, "not of its colours"),
        ({"a/layers/f": tiles.replace(b"TILEWIDTH 64", b"TILEWIDTH 99999")}, "not of its colours"),
        ({"a/layers/f": tiles.replace(b"0,0,LZF", b"0,0,ZIP")}, "damaged"),
        ({"maindoc.xml": good["maindoc.xml"].replace(b"='f'", b"='g'")}, "is missing"),
    ):
        yield painted.zipped(good | change), "Ink", words
    yield painted.zipped(good), None, "no merged picture"
    yield painted.zipped({"a.txt": b"a"}), None, "neither Krita's nor OpenRaster"
    yield painted.zipped(good)[:-30], "Ink", "damaged zip"
    psd = painted.psd(SIZE, [("Ink", INK, 0, 0, None)], MERGED)
    yield psd[:-10], None, "cut short"
    yield psd[:300], "Ink", "cut short"
    yield psd[:24], None, "cut short"
    unreal = painted.resource(1057, b"\0\0\0\1\0")
    layers = [("Ink", INK, 0, 0, None), ("Empty", INK[:0, :0], 0, 0, None)]
    unreal = painted.psd(SIZE, layers, MERGED, resources=unreal)
    yield unreal, None, "has no merged picture"
    yield unreal, "Empty", "no pixels of its own"
    yield painted.psd(SIZE, [], MERGED, mode=7), None, "mode 7"
    yield painted.png(MERGED), "Ink", "has no layers, so none named 'Ink'"


def named(value):
    """A case's name; not of a ZIP's bytes, which hold the time that it was made at."""
    return value[:4].hex() if isinstance(value, bytes) else str(value)[:20]


@pytest.mark.parametrize("data, layer, words", list(refused()), ids=named)
def test_what_is_refused(tmp_path, data, layer, words):
    path = tmp_path / "d.kra"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=words) as error:
        read_image(path, layer=layer)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_no_entry_is_unpacked_beyond_a_limit(tmp_path, monkeypatch):
    from strokestyle.fit import layered_file

    (tmp_path / "d.ora").write_bytes(painted.ora(SIZE, LAYERS, MERGED))
    monkeypatch.setattr(layered_file, "MAX_ENTRY", 100)
    with pytest.raises(ValueError, match="is larger than"):
        read_image(tmp_path / "d.ora")

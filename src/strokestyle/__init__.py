"""Learn how an artist draws lines from one drawing of a 3D shape, and draw any other shape in that
hand.

The alphabet of array axes, used in every signature, comment and error of this package:

    V  vertices        F  faces          N  curve or stroke points
    C  curves, strokes K  feature maps   B  batch
    H, W  pixels

Ragged data is flat rows plus `offsets` (C+1,): curve i is rows offsets[i]:offsets[i+1].
Image coordinates are pixels, x right, y down, (0, 0) the top-left corner of the image, pixel
centres at +1/2. The 3D world is right-handed; after `load_surface` a shape is centred and its
longest side is 1. Thickness is a stroke's full width in pixels. Angles are degrees at the command
line and in `Camera.fov_y`."""

from importlib import import_module

__version__ = "0.2.0"

# What Python users may rely on, and where it is: resolved when it is asked for, so that `import
# strokestyle` stays free
# of numpy and torch.
_PUBLIC = {
    "Camera": "extract.camera",
    "Checkpoint": "fit.checkpoint",
    "Curves": "geometry.curves",
    "Drawing": "drawing.strokes",
    "Exemplar": "fit.exemplar",
    "FilmPage": "film.page",
    "FitConfig": "fit.config",
    "Frame": "motion.frames",
    "LineOptions": "extract.line_options",
    "PRESETS": "fit.train",
    "Pictures": "film.pictures",
    "Shot": "motion.frames",
    "Strokes": "drawing.strokes",
    "Style": "render.style",
    "Surface": "mesh.surface",
    "SvgOptions": "svg.format",
    "Texture": "drawing.strokes",
    "View": "extract.view",
    "cut_open": "mesh.section",
    "draw_frames": "motion.draw",
    "extract_view": "extract.pipeline",
    "fit_camera": "extract.camera",
    "fit_style": "fit.train",
    "fit_turntable_camera": "extract.turntable",
    "hide_parts": "mesh.hide",
    "load_cameras": "motion.shots",
    "load_curves": "render.curve_file",
    "load_exemplar": "fit.exemplar",
    "load_sequence": "mesh.sequence",
    "load_style": "render.style_file",
    "load_surface": "mesh.surface",
    "load_view": "extract.view_file",
    "make_surface": "mesh.surface",
    "move": "drawing.edit",
    "parse_section": "mesh.planes",
    "path_shots": "motion.shots",
    "plain_svg": "svg.write",
    "plan_outputs": "batch.plan",
    "png_from_svg": "svg.write",
    "rasterise": "drawing.raster",
    "read_svg": "svg.read",
    "recolor": "drawing.edit",
    "restyle": "render.restyle",
    "save_style": "render.style_file",
    "save_svg": "svg.write",
    "save_view": "extract.view_file",
    "simplify": "drawing.edit",
    "smooth": "drawing.edit",
    "taper": "drawing.edit",
    "thicken": "drawing.edit",
    "track_frames": "motion.track",
    "turntable": "extract.turntable",
    "turntable_shots": "motion.shots",
    "view_of_curves": "extract.pipeline",
    "wiggle": "drawing.edit",
    "write_film": "film.films",
    "write_frames": "svg.write",
    "write_svg": "svg.write",
}
__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str):
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_PUBLIC[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})

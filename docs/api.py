"""Make docs/python.md anew from the public names and their docstrings: python docs/api.py"""

from __future__ import annotations

import inspect
from pathlib import Path

import strokestyle

PAGE = Path(__file__).parent / "python.md"
HEAD = """# Python

Made by `python docs/api.py` from the docstrings; `from strokestyle import NAME` for each of these.
Whatever else a module holds may change without notice. Nothing is imported before it is asked for,
so that `import strokestyle` costs nothing.

A stage is a function from one frozen dataclass to the next:

    load_surface -> Surface, extract_view -> View, fit_style -> Style, Style.draw -> Drawing,
    save_svg

Errors are ValueError (a value or a file that cannot be used) or OSError (a file that cannot be read
or written), in one line that names what was found and what would do.

"""
# In the order of the walk from a mesh to a drawing; what is listed nowhere is an error here.
GROUPS = {
    "Shapes and views": (
        "load_surface", "make_surface", "Surface", "hide_parts", "parse_section", "cut_open",
        "Camera", "fit_camera", "LineOptions", "extract_view",
        "view_of_curves", "View", "Curves", "load_curves", "save_view", "load_view",
        "fit_turntable_camera", "turntable",
    ),
    "Learning a style": (
        "load_exemplar", "Exemplar", "fit_style", "PRESETS", "FitConfig", "Checkpoint", "Style",
        "save_style", "load_style",
    ),
    "Drawings": (
        "Drawing", "Strokes", "Texture", "thicken", "wiggle", "smooth", "simplify", "move", "taper",
        "recolor", "restyle", "plan_outputs", "rasterise",
    ),
    "Animation": (
        "load_sequence", "load_cameras", "turntable_shots", "path_shots", "Shot", "track_frames",
        "Frame", "draw_frames", "write_frames", "Pictures", "write_film", "FilmPage",
    ),
    "SVG": ("SvgOptions", "write_svg", "save_svg", "read_svg", "plain_svg", "png_from_svg"),
}  # fmt: skip


class Written(str):
    """An annotation as it is written, without the quotes of postponed evaluation."""

    __repr__ = str.__str__


def call(name: str, value) -> str:
    """How a function or a class is called, an argument a line: long defaults are cut to `...`."""
    signature = inspect.signature(value)
    shown = []
    for parameter in signature.parameters.values():
        if parameter.annotation is not parameter.empty:
            parameter = parameter.replace(annotation=Written(parameter.annotation))
        if len(repr(parameter.default)) > 40:
            parameter = parameter.replace(default=Written("..."))
        shown.append(str(parameter))
    result = signature.return_annotation
    to = "" if result in (signature.empty, "None", None) else f" -> {result}"
    line = f"{name}({', '.join(shown)}){to}"
    return line if len(line) <= 100 else f"{name}(\n    " + ",\n    ".join(shown) + f"\n){to}"


def described(name: str, value) -> str:
    """A call and its docstring."""
    return f"```text\n{call(name, value)}\n\n{inspect.getdoc(value)}\n```\n"


def entry(name: str) -> str:
    """One public name: how it is called, what its docstring says, and its methods likewise."""
    value = getattr(strokestyle, name)
    if not callable(value):
        return f"### {name}\n\nBy name: {', '.join(f'`{key}`' for key in value)}.\n"
    text = f"### {name}\n\n{described(name, value)}"
    if inspect.isclass(value):
        for method, function in vars(value).items():
            plain = getattr(function, "__func__", function)
            if not method.startswith("_") and inspect.isfunction(plain) and plain.__doc__:
                text += "\n" + described(f"{name}.{method}", plain)
    return text


def page() -> str:
    """The whole page."""
    listed = {name for names in GROUPS.values() for name in names}
    public = set(strokestyle.__all__) - {"__version__"}
    if listed != public:
        raise ValueError(f"GROUPS and strokestyle.__all__ differ in {sorted(listed ^ public)}")
    parts = [f"## {group}\n\n" + "\n".join(map(entry, names)) for group, names in GROUPS.items()]
    return HEAD + "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

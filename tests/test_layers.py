"""Imports go one way: every module imports only modules of a strictly lower rank, and only some import torch."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent.parent / "src" / "strokestyle"
RANK = {
    "files": 0, "camera": 0, "mesh_files": 0, "edges": 0, "curves": 0, "raster": 0, "model": 0,
    "devices": 0, "cubics": 0, "parts": 0,
    "palette": 0,
    "registration": 0, "isolines": 0,
    "intersections": 0, "creases": 0,
    "svg_text": 0, "svg_syntax": 1,
    "surface": 1, "visibility": 1, "chaining": 1, "strokes": 1, "exemplar": 1, "planning": 1,
    "checkpoint": 1, "svg_page": 1, "model_file": 1,
    "feature_curves": 2, "curve_files": 2, "outlines": 2, "inks": 2,
    "view": 3, "ribbons": 3,
    "painting": 4, "strips": 2, "svg_texture": 4, "svg_read": 5, "edits": 4, "svg_lines": 3,
    "texture": 5, "pictures": 5, "tones": 4, "svg": 6,
    "paper": 6, "stages": 7, "page": 7,
    "style": 7, "paper_fit": 7,
    "fit": 8,
    "cli": 9,
}  # fmt: skip
TORCH = {"checkpoint", "devices", "raster", "model", "paper", "paper_fit", "fit"}
ONLY = {"resvg_py": {"svg"}, "click": {"cli"}, "rich": {"cli"}, "embreex": {"visibility"}}


def imports(path):
    """(module, top level?) of every import in a file; our own modules as ".name"."""
    tree = ast.parse(path.read_text())
    top = set(tree.body)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name.split(".")[0], node in top) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level:
            names = [node.module] if node.module else [alias.name for alias in node.names]
            yield from (("." + name, node in top) for name in names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.split(".")[0], node in top


MODULES = sorted(path.stem for path in SOURCE.glob("*.py") if not path.stem.startswith("__"))


def test_every_module_has_a_rank():
    assert set(MODULES) == set(RANK)


@pytest.mark.parametrize("name", MODULES)
def test_imports_point_down(name):
    for module, _ in imports(SOURCE / f"{name}.py"):
        if module.startswith(".") and module != ".__version__":
            assert RANK[module[1:]] < RANK[name], f"{name} imports {module[1:]}"
        if module == "torch":
            assert name in TORCH or name == "cli"
        assert name in ONLY.get(module, {name}), f"{module} belongs to {ONLY.get(module)}"


def test_the_command_line_starts_without_the_heavy_libraries():
    heavy = {"torch", "numpy", "scipy", "trimesh", "embreex", "PIL", "rich"}
    for module, top in imports(SOURCE / "cli.py"):
        assert not (top and (module in heavy or module.startswith(".") and module[1:] in RANK)), module


def test_a_mesh_is_drawn_without_torch():
    """Its import takes longer than all that `render` does."""
    seen, todo = set(), ["surface", "visibility", "view", "style", "svg"]
    while todo:
        name = todo.pop()
        if name not in seen:
            seen.add(name)
            todo += [module[1:] for module, top in imports(SOURCE / f"{name}.py") if top and module[1:] in RANK]
    assert "texture" in seen and not seen & TORCH

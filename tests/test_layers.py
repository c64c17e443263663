"""Imports go one way, and only some modules import the heavy libraries."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent.parent / "src" / "strokestyle"
# A package imports only packages that stand before its bar.
RULE = (
    "files | geometry | mesh | extract, drawing | svg | viewer | render, film, batch | fit, "
    "motion | cli"
)
# Shapes and drawings are two halves that meet in render.
STRANGERS = {("drawing", "mesh"), ("svg", "mesh"), ("svg", "extract"), ("viewer", "extract")}
RANK = {name: i for i, group in enumerate(RULE.split(" | ")) for name in group.split(", ")}
TORCH = {
    "render.networks",
    "render.devices",
    "render.coverage",
    "render.neural_strokes",
    "fit.*",
    "cli",
}
ONLY = {
    "resvg_py": {"svg.write"},
    "svgwrite": {"svg.tree"},
    "pydyf": {"svg.pdf"},
    "click": {"cli"},
    "rich": {"cli"},
    "embreex": {"extract.embree"},
    "dask": {"batch.cluster"},
    "distributed": {"batch.cluster"},
}
MODULES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts): path
    for path in sorted(SOURCE.rglob("*.py"))
}
MODULES = {
    name.removesuffix(".__init__"): path for name, path in MODULES.items() if name != "__init__"
}


def imports(name):
    """(module, whether at the top) of every import in a module; our own by name, from the root."""
    tree = ast.parse(MODULES[name].read_text())
    home = name.split(".") if MODULES[name].name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(tree):
        top = node in tree.body
        if isinstance(node, ast.Import):
            yield from ((alias.name.split(".")[0], top) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module.split(".")[0], top
        elif isinstance(node, ast.ImportFrom):
            base = home[: len(home) - node.level + 1] + (node.module or "").split(".")
            base = [word for word in base if word]
            for alias in node.names:
                deeper = ".".join([*base, alias.name])
                yield "." + (deeper if deeper in MODULES else ".".join(base)), top


def test_every_package_stands_in_the_rule():
    assert {name.split(".")[0] for name in MODULES} == {*RANK, "__main__"}
    page = (SOURCE.parent.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert f"`{RULE}`" in page


@pytest.mark.parametrize("name", [name for name in MODULES if name != "__main__"])
def test_a_package_imports_only_what_stands_before_its_bar(name):
    package = name.split(".")[0]
    for module, _ in imports(name):
        other = module[1:].split(".")[0]
        if module.startswith(".") and other not in ("", package):
            assert RANK[other] < RANK[package], f"{name} imports {module[1:]}"
            assert (package, other) not in STRANGERS, f"{name} imports {module[1:]}"
        if module == "torch":
            assert TORCH & {name, f"{package}.*"}, f"{name} imports torch"
        assert {name, package} & ONLY.get(module, {name}), f"{module} belongs to {ONLY.get(module)}"


def test_no_circles_inside_a_package():
    above = {
        name: {module[1:] for module, _ in imports(name) if module[1:] in MODULES}
        for name in MODULES
    }
    seen = []

    def visit(name, path):
        assert name not in path, " -> ".join([*path, name])
        if name not in seen:
            for other in above[name]:
                visit(other, [*path, name])
            seen.append(name)

    for name in MODULES:
        visit(name, [])


def imported_with(*names):
    """Our modules that importing these brings in: themselves, and what they import at their top."""
    seen, todo = set(), list(names)
    while todo:
        name = todo.pop()
        if name not in seen:
            seen.add(name)
            todo += [module[1:] for module, top in imports(name) if top and module[1:] in MODULES]
    return seen


def test_the_command_line_starts_without_the_heavy_libraries():
    heavy = {"torch", "numpy", "scipy", "trimesh", "embreex", "PIL", "rich"}
    loaded = imported_with("cli")
    for name in loaded:
        assert not heavy & {module for module, top in imports(name) if top}, name
    late = {name for name in MODULES if name.startswith("cli.")} - loaded
    assert late == {"cli.edit_text"}  # it edits; the others make the help texts


def test_a_mesh_is_drawn_without_torch():
    """Its import takes longer than all that `render` does."""
    seen = imported_with("mesh.surface", "extract.pipeline", "render.style_file", "svg.write")
    torch = {name for name in seen if "torch" in dict(imports(name))}
    assert "render.quilt" in seen and not torch


def test_a_mesh_is_drawn_without_scipy():
    """Its import takes a fifth of the time that `render` does."""
    seen = imported_with("mesh.surface", "extract.pipeline", "render.style_file", "svg.write")
    lines = [line for name in seen for line in MODULES[name].read_text().splitlines()]
    assert not [
        line for line in lines if line.startswith(("from scipy", "from PIL", "from trimesh"))
    ]
    assert not seen & {"batch.pool", "mesh.read_gltf", "mesh.section"}


def test_thickness_is_scaled_without_scipy():
    """Its import takes half as long as all that `edit --thickness` does besides."""
    seen = imported_with("cli.edit", "cli.edit_text", "svg.rescale")
    heavy = {"scipy", "trimesh", "torch"}
    assert "svg.tones" in seen and "extract.pipeline" not in seen
    assert not [name for name in seen if heavy & {module for module, top in imports(name) if top}]


def test_a_fast_preset_learns_without_torch():
    """Its import takes as long as a third of what `fit --preset quick` does besides."""
    seen = imported_with("fit.train", "fit.exemplar", "fit.checkpoint", "fit.report")
    torch = {name for name in seen if dict(imports(name)).get("torch")}
    assert "fit.cover" in seen and not torch


def test_svgwrite_is_imported_when_a_file_is_written():
    """What only reads a file, or asks how it would be written, does without."""
    seen = imported_with("svg.write", "svg.read", "render.figure")
    assert "svg.document" in seen and "svg.tree" not in seen

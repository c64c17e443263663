"""The SHAPE argument: a mesh or a saved view, read once, and the views that the options ask for."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .messages import say, timed, told_warnings
from .options import curve_options, line_options, shape_options, view_options

if TYPE_CHECKING:
    import numpy as np

    from ..extract.camera import Camera
    from ..extract.line_options import LineOptions
    from ..extract.view import View
    from ..mesh.surface import Surface


class Shape:
    """A mesh, or a view that extract saved, and how the options want to see it.

    Parameters
    ----------
    path : its file
    options : values of the view, line and curve options and of "hidden" and "turntable", by their
        parameters' names; None where not given

    Raises
    ------
    click.UsageError
        where options contradict each other, or a saved view.
    FileNotFoundError
        where there is no such mesh.
    """

    def __init__(self, path: str, options: Mapping[str, Any]):
        from ..batch.plan import VIEW_SUFFIXES

        self.path, self.options = path, options
        self.is_view = Path(path).suffix.lower() in VIEW_SUFFIXES
        self.has_own_curves = not (self.is_view or options.get("curves"))
        _refuse_two_cameras(options)
        _refuse_angle_of_parallel(options)
        if options.get("hidden") and not self.has_own_curves:
            raise click.UsageError(
                "--hidden needs a mesh and its own curves, not a saved view or --curves"
            )
        if options.get("turntable") and not self.has_own_curves:
            raise click.UsageError(
                "--turntable needs a mesh and its own curves: a saved view and --curves "
                "have one side"
            )
        if self.is_view:
            self._refuse_options()
        elif not Path(path).exists():
            raise FileNotFoundError(f"{path}: no such file")

    def _refuse_options(self) -> None:
        """Raise a usage error where an option is given that a saved view has settled."""
        groups = (line_options, curve_options, view_options, shape_options)
        given = [flag for group in groups for flag in group.given_flags(self.options)]
        if given:
            raise click.UsageError(
                f"{self.path} is a saved view, with camera and curves: leave out {', '.join(given)}"
            )

    @functools.cached_property
    def surface(self) -> Surface:
        """The mesh, cleaned and measured."""
        from ..mesh.surface import load_surface

        with timed("read the mesh"), told_warnings():
            return load_surface(self.path)

    @functools.cached_property
    def shown(self) -> Surface:
        """The mesh less the parts that are hidden, cut open where the options ask for it."""
        surface, hide, cuts = self.surface, self.options.get("hide"), self.options.get("section")
        try:
            if hide:
                from ..mesh.hide import hide_parts

                surface = hide_parts(surface, hide)
            if cuts:
                from ..mesh.messages import naming
                from ..mesh.planes import parse_section
                from ..mesh.section import cut_open

                planes = [parse_section(text) for text in cuts]
                with timed("cut it open"), told_warnings(), naming(self.path):
                    surface = cut_open(surface, planes, self.camera().viewpoint, self.surface)
        except ValueError as error:
            raise ValueError(f"{self.path}: {error}") from None
        return surface

    def camera(self) -> Camera:
        """The camera that the options ask for; with --turntable it sees the shape all round.

        It is fitted to the whole mesh, whatever is left out or cut off: pictures lie on each other.
        """
        from ..extract.camera import Camera

        if self.options.get("camera"):
            return Camera.load(self.options["camera"])
        return self.fitted(self.surface.vertices)

    def fitted(self, vertices: np.ndarray) -> Camera:
        """The camera that the view options ask for, fitted to vertices (V, 3)."""
        from ..extract.camera import DEFAULT_FOV, DEFAULT_SIZE, fit_camera
        from ..extract.turntable import fit_turntable_camera

        options = self.options
        width, height = options.get("size") or (DEFAULT_SIZE, DEFAULT_SIZE)
        fit = fit_turntable_camera if options.get("turntable") else fit_camera
        return fit(
            vertices,
            options.get("view") or "three-quarter",
            options.get("fov") or DEFAULT_FOV,
            width,
            height,
            options.get("up") or "y",
            options.get("projection"),
        )

    @property
    def has_optional_lines(self) -> bool:
        """Whether lines of a fuller detail may be drawn: where no option says which are."""
        own = [name for name in line_options.given(self.options) if name != "kinds"]
        return self.has_own_curves and not own and not self.options.get("detail")

    def view(self, optional: bool = False) -> View:
        """The view that the file holds, or that of the mesh from the camera.

        `optional` : with the lines besides that an artist may draw, where the options leave it open
        """
        from ..extract.pipeline import extract_view
        from ..extract.view_file import load_view
        from ..mesh.messages import naming

        if self.is_view:
            return load_view(self.path)
        if self.options.get("curves"):
            return self._view_of_curves()
        surface, camera, hidden = self.shown, self.camera(), self.options.get("hidden", False)
        with timed("curves"), told_warnings(), naming(self.path):
            return extract_view(
                surface,
                camera,
                self.line_options(),
                self.spacing(),
                hidden,
                optional=optional and self.has_optional_lines,
            )

    def _view_of_curves(self) -> View:
        """The mesh seen behind the curves of another program."""
        from ..extract.pipeline import view_of_curves
        from ..render.curve_file import load_curves, unread_properties

        camera, path = self.camera(), self.options["curves"]
        curves = load_curves(path, (camera.width, camera.height))
        if unread := unread_properties(path):
            found = ", ".join(f"{name} {count}" for name, count in unread.items())
            say(f"{path}: not looked at, so that curves may be longer or elsewhere: {found}")
        with timed("curves"):
            return view_of_curves(self.shown, camera, curves, self.spacing())

    def views(self, optional: bool = False) -> Iterator[View]:
        """The view; or with --turntable N views, once round the upright axis.

        `optional` : as `view` takes it
        """
        from ..extract.camera import up_axis
        from ..extract.turntable import turntable
        from ..mesh.messages import naming

        count = self.options.get("turntable")
        if not count:
            yield self.view(optional)
            return
        axis = None if self.options.get("camera") else up_axis(self.options.get("up") or "y")
        views = turntable(
            self.shown,
            self.camera(),
            count,
            self.line_options(),
            self.spacing(),
            axis=axis,
            optional=optional and self.has_optional_lines,
        )
        for _ in range(count):
            with timed("curves"), told_warnings(), naming(self.path):
                view = next(views)
            yield view

    def line_options(self) -> LineOptions:
        """Which lines the options ask for."""
        from ..extract.line_options import LineOptions

        options = LineOptions(**line_options.given(self.options))
        detail = self.options.get("detail")
        return options.detailed(*detail) if detail else options

    def spacing(self) -> float:
        """The distance between the points of the curves that the options ask for, px."""
        from ..geometry.curves import DEFAULT_SPACING

        return self.options.get("spacing") or DEFAULT_SPACING


def _refuse_two_cameras(options: Mapping[str, Any]) -> None:
    flags = [flag for flag in view_options.given_flags(options) if flag != "--camera"]
    if options.get("camera") and flags:
        raise click.UsageError(
            f"--camera already says where the eye stands: leave out {', '.join(flags)}"
        )


def _refuse_angle_of_parallel(options: Mapping[str, Any]) -> None:
    if options.get("fov") is None or options.get("camera"):
        return
    from ..extract.camera import projection_of

    view, asked = options.get("view") or "three-quarter", options.get("projection")
    if (asked or projection_of(view)) == "parallel":
        which = "--projection parallel" if asked else f"--view {view}"
        raise click.UsageError(
            f"{which} has no field of view: leave out --fov, or give --projection perspective"
        )

# SPDX-License-Identifier: Apache-2.0
"""Blender's side of Plateau: sends a still to the farm, shows how it comes, and loads the result.

Render Properties > Plateau. The farm's URL and key are in the add-on's preferences.
"""

import shutil
import tempfile
from pathlib import Path
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from .farm import Farm, FarmError
from .submission import News, Submission

bl_info = {
    "name": "Plateau Render Farm",
    "author": "Plateau",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "Properties > Render > Plateau",
    "description": "Render a still on many machines, until the eye can tell no more",
    "category": "Render",
}

#: How often Blender looks for news.
_LOOK_S = 0.5
_IMAGE = "Plateau"


class PlateauPreferences(bpy.types.AddonPreferences):
    """Where the farm is; a setting of the user's, and of no file."""

    bl_idname = __package__

    url: StringProperty(
        name="Farm",
        description="The URL of the farm's API",
        default="http://127.0.0.1:8713",
    )
    key: StringProperty(
        name="Key",
        description="Your API key, if the farm asks for one",
        subtype="PASSWORD",
    )

    def draw(self, _context: Any) -> None:
        """Show both."""
        self.layout.prop(self, "url")
        self.layout.prop(self, "key")


class PlateauSettings(bpy.types.PropertyGroup):
    """What a scene asks of the farm."""

    job: StringProperty(name="Name", description="The job's name; by default that of the file")
    rule: EnumProperty(
        name="Stop",
        description="When the job ends",
        items=(
            (
                "jod",
                "When it is good enough",
                "Nearly as good as the end, on a desk at 200 %",
            ),
            ("visible", "When noise is invisible", "So few pixels differ visibly from the end"),
            ("fixed", "At the cap", "When it has all samples of the cap"),
        ),
    )
    target: FloatProperty(
        name="Noise left",
        description="The share of the pixels that may still differ visibly",
        default=0.02,
        min=0.001,
        max=50.0,
        precision=3,
        subtype="PERCENTAGE",
    )
    cap: IntProperty(
        name="Cap",
        description="The most samples per pixel",
        default=10_000,
        min=1,
        max=1_000_000,
    )
    denoise: bpy.props.BoolProperty(
        name="Denoise",
        description="Judge and deliver the image blended with its denoised self",
    )
    folder: StringProperty(
        name="Output",
        description="The folder for the image; // is the folder of the file",
        default="//plateau",
        subtype="DIR_PATH",
    )


class _Now:
    """The one submission of this session, and what is said of it."""

    submission: Submission | None = None
    text = ""
    is_error = False
    folder: Path | None = None


def spec_of(settings: Any, name: str) -> dict[str, Any]:
    """Return the spec of a job with a scene's settings."""
    cap = settings.cap
    parameters = {"visible": {"target": settings.target / 100}, "fixed": {"spp": cap}}
    rule = {"name": settings.rule, **parameters.get(settings.rule, {})}
    spec: dict[str, Any] = {"name": (settings.job or name)[:100], "max_spp": cap, "rule": rule}
    return {**spec, "denoise": {"name": "oidn"}} if settings.denoise else spec


class PlateauSubmit(bpy.types.Operator):
    """Sends the file to the farm."""

    bl_idname = "plateau.submit"
    bl_label = "Render on the farm"
    bl_description = "Pack the file, send it to the farm, and show the image as it comes"

    @classmethod
    def poll(cls, _context: Any) -> bool:
        """Return whether nothing is being rendered for this session."""
        return _Now.submission is None

    def execute(self, context: Any) -> set[str]:
        """Save a copy, and leave the rest to a thread."""
        preferences = context.preferences.addons[__package__].preferences
        scene = context.scene
        try:
            farm = _farm(preferences, scene)
        except FarmError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        name = Path(bpy.data.filepath).stem or "untitled"
        _forget_folder()
        _Now.folder = Path(tempfile.mkdtemp(prefix="plateau-"))
        copy = _Now.folder / "scene.blend"
        # The farm renders the scene of the window at its current frame.
        bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, relative_remap=True)
        spec = spec_of(scene.plateau, name)
        result = _result_path(scene.plateau.folder, spec["name"], scene.frame_current)
        _Now.submission = Submission(farm, copy, spec, result)
        _Now.text, _Now.is_error = "saved a copy", False
        if not bpy.app.timers.is_registered(look):
            bpy.app.timers.register(look, first_interval=_LOOK_S)
        return {"FINISHED"}


class PlateauCancel(bpy.types.Operator):
    """Cancels the job."""

    bl_idname = "plateau.cancel"
    bl_label = "Cancel"
    bl_description = "End the job on the farm, with the image that it has"

    @classmethod
    def poll(cls, _context: Any) -> bool:
        """Return whether there is something to cancel."""
        return _Now.submission is not None

    def execute(self, _context: Any) -> set[str]:
        """Have the thread tell the farm."""
        assert _Now.submission is not None
        _Now.submission.cancel()
        return {"FINISHED"}


class PlateauPanel(bpy.types.Panel):
    """Plateau, in the render properties."""

    bl_idname = "RENDER_PT_plateau"
    bl_label = "Plateau"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    def draw(self, context: Any) -> None:
        """Show the settings, the two buttons, and what is said of the job."""
        settings, layout = context.scene.plateau, self.layout
        layout.use_property_split = True
        layout.prop(settings, "job")
        layout.prop(settings, "rule")
        if settings.rule == "visible":
            layout.prop(settings, "target")
        for name in ("cap", "denoise", "folder"):
            layout.prop(settings, name)
        row = layout.row()
        row.operator(PlateauSubmit.bl_idname, icon="RENDER_STILL")
        row.operator(PlateauCancel.bl_idname, icon="CANCEL")
        if _Now.text:
            layout.label(text=_Now.text, icon="ERROR" if _Now.is_error else "INFO")


def look() -> float | None:
    """Show the news of the submission; returns when to look again, as Blender's timers ask it.

    Of several pictures that have come, the last one is shown.
    """
    submission = _Now.submission
    if submission is None:
        return None
    for news in submission.news():
        _Now.text, _Now.is_error = news.text, news.is_error
        if news.image is not None:
            _show(news)
        if news.is_over:
            _Now.submission = None
    for area in (
        one for window in bpy.context.window_manager.windows for one in window.screen.areas
    ):
        area.tag_redraw()
    return _LOOK_S if _Now.submission is not None else None


def state() -> tuple[str, bool, bool]:
    """Return what the panel says, whether that is an error, and whether all is over."""
    return _Now.text, _Now.is_error, _Now.submission is None


def _farm(preferences: Any, scene: Any) -> Farm:
    if scene.render.engine != "CYCLES":
        raise FarmError("the farm renders Cycles: set the render engine to it")
    if scene.camera is None:
        raise FarmError("the scene has no camera")
    changed = [one.name for one in bpy.data.images if one.is_dirty and one.users]
    if changed:
        raise FarmError(f"images with changes that are not saved: {', '.join(changed)}")
    farm = Farm(preferences.url, preferences.key)
    if not (bpy.app.online_access or farm.is_this_machine):
        raise FarmError("Blender may not go online: Preferences > System > Allow Online Access")
    return farm


def _result_path(folder: str, name: str, frame: int) -> Path:
    assert _Now.folder is not None
    is_beside = folder.startswith("//")
    base = _Now.folder if is_beside and not bpy.data.filepath else Path(bpy.path.abspath(folder))
    return base / f"{bpy.path.clean_name(name)}-{frame:04}.exr"


def _show(news: News) -> None:
    """Load a picture into the one image that editors show, or the linear image in its place."""
    shown = bpy.data.images.get(_IMAGE)
    if shown is None:
        shown = bpy.data.images.load(str(news.image))
        shown.name = _IMAGE
    shown.filepath = str(news.image)
    shown.colorspace_settings.name = "Linear Rec.709" if news.is_result else "sRGB"
    shown.use_view_as_render = news.is_result
    shown.reload()


def _forget_folder() -> None:
    """Remove what the last submission has left, but for a result that an unsaved file shows."""
    shown = bpy.data.images.get(_IMAGE)
    folder, _Now.folder = _Now.folder, None
    if folder is not None and not (shown and Path(shown.filepath).parent == folder):
        shutil.rmtree(folder, ignore_errors=True)


_CLASSES = (PlateauPreferences, PlateauSettings, PlateauSubmit, PlateauCancel, PlateauPanel)


def register() -> None:
    """Add the panel and its operators to Blender."""
    for one in _CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.plateau = PointerProperty(type=PlateauSettings)


def unregister() -> None:
    """Remove them; a job on the farm goes on."""
    if _Now.submission is not None:
        _Now.submission.leave()
        _Now.submission = None
    if bpy.app.timers.is_registered(look):
        bpy.app.timers.unregister(look)
    _forget_folder()
    del bpy.types.Scene.plateau
    for one in reversed(_CLASSES):
        bpy.utils.unregister_class(one)

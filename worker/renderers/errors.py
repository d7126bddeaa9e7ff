"""What the render child reports on purpose; importable without Mitsuba."""


class SceneError(Exception):
    """The scene cannot be rendered, here or anywhere; the message is Mitsuba's where it has one."""

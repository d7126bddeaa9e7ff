"""The files of a sequence's images: one for each job of a batch, named by a pattern."""

import unicodedata
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path, PurePath
from string import Formatter
from typing import Final

from plateau.errors import CommandFailed
from plateau.farm.wire.views import JobView

#: The image of a job that a file with this suffix is.
IMAGES: Final = {".exr": "image.exr", ".png": "image.png"}
_NOT_IN_FILES: Final = frozenset("/\\\x7f\x85\u2028\u2029").union(map(chr, range(32)))
_OF_JOB: Final = ("batch", "name", "id", "place")


class OutPattern:
    """A path with fields, such as ``shots/{batch}.{frame:04d}.exr``.

    Fields are ``batch``, ``name``, ``id``, ``place`` (of the job in its batch, from 0) and the
    parameters of the job's scene; a format follows a colon, as in Python.

    Parameters
    ----------
    text : str
        The pattern.

    Raises
    ------
    CommandFailed
        It is none, or names no image file.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        try:
            fields = [part[1:] for part in Formatter().parse(text) if part[1] is not None]
        except ValueError as error:
            raise CommandFailed(f"-o {text!r} is no pattern: {error}") from None
        for name, layout, conversion in fields:
            if not str(name).isidentifier() or conversion or "{" in str(layout):
                raise CommandFailed(
                    f"-o {text!r}: a field is a name and perhaps a format, such as {{frame:04d}}"
                )
        if PurePath(text).suffix not in IMAGES:
            raise CommandFailed(f"-o {text!r} names no image: let it end with .exr or .png")

    @staticmethod
    def is_one(text: str) -> bool:
        """Whether a path has fields, and so is a pattern."""
        return "{" in text

    @property
    def image(self) -> str:
        """The image of a job that the files are."""
        return IMAGES[PurePath(self.text).suffix]

    def files(self, jobs: Iterable[JobView]) -> dict[str, Path]:
        """Return the file of each job of a batch, by its id.

        Parameters
        ----------
        jobs : iterable of JobView
            The batch's, in their order. Of jobs of one scene, sensor and parameters the last has
            the file: a frame was rendered again.

        Raises
        ------
        CommandFailed
            A field is unknown, a value does not fit its format or cannot be in a file's name, or
            jobs that differ would have one file.
        """
        takers: dict[str, tuple[Path, JobView]] = {}
        for place, job in enumerate(jobs):
            path = self._file(job, place)
            # Some file systems tell apart neither case nor the ways to write an accented letter.
            place_on_disk = unicodedata.normalize("NFC", str(path)).casefold()
            other, before = takers.get(place_on_disk, (path, None))
            if before is not None and _what_it_shows(before) != _what_it_shows(job):
                raise CommandFailed(
                    f"-o {self.text!r} gives the jobs {before.id} and {job.id} one file, {path}"
                    f"{'' if path == other else f', where case does not count (also {other})'}: "
                    f"let it have what they differ in, such as {{{_difference(before, job)}}}"
                )
            takers[place_on_disk] = path, job
        return {job.id: path for path, job in takers.values()}

    def _file(self, job: JobView, place: int) -> Path:
        own = dict(zip(_OF_JOB, (job.spec.batch or "", job.name, job.id, place), strict=True))
        values: Mapping[str, object] = {**job.spec.parameters, **own}
        try:
            return Path("".join(self._parts(values)))
        except KeyError as missing:
            raise CommandFailed(
                f"-o {self.text!r}: the job {job.id} has no {missing}; it has {', '.join(values)}"
            ) from None

    def _parts(self, values: Mapping[str, object]) -> Iterable[str]:
        for literal, name, layout, _ in Formatter().parse(self.text):
            yield literal
            if name is None:
                continue
            value = values[name]
            try:
                shown = _laid_out(value, layout or "")
            except (ValueError, OverflowError) as error:
                raise CommandFailed(
                    f"-o {self.text!r}: {name} is {value!r} here, which has no format {layout!r}: "
                    f"{error}"
                ) from None
            if not shown or shown in {".", ".."} or set(shown) & _NOT_IN_FILES:
                raise CommandFailed(
                    f"-o {self.text!r}: {name} is {shown!r} here, which cannot be in a file's name"
                )
            yield shown


def _what_it_shows(job: JobView) -> Mapping[str, object]:
    """What tells the frame of a job from others.

    Parameters are as Mitsuba reads them: 1 and "1" are one frame.
    """
    return {**job.spec.parameter_strings(), "name": job.name, "sensor": job.spec.sensor}


def _laid_out(value: object, layout: str) -> str:
    """The value in its format; text of a number, as command lines and CSV give it, is one."""
    if layout and isinstance(value, str):
        for kind in (int, float):
            with suppress(ValueError):
                return format(kind(value), layout)
    return format(value, layout)


def _difference(one: JobView, other: JobView) -> str:
    """The first field in which two jobs differ: sensors have none, but the jobs have ids."""
    had, has = _what_it_shows(one), _what_it_shows(other)
    name = next(name for name in {**had, **has} if had.get(name) != has.get(name))
    return "id" if name == "sensor" else name

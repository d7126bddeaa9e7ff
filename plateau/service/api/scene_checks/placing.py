"""Bundles of scenes where they lie: made in a process for each, while the client waits.

Reading a scene's files for the first time can take minutes; so this takes no slot of the checks,
and the bundle has to pass those afterwards as an upload does. A file that was read once is not read
again until it changes, also where the client did not wait for the end.
"""

import asyncio
import json
import signal
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

from plateau.farm.bundle import BundleError, BundleLimits
from plateau.farm.model.scene_roots import SceneRoot
from plateau.farm.process.lifecycle import die_with_parent, plain_environment
from plateau.service.api.scene_checks import placing_child
from plateau.service.api.scene_checks.pool import IsGone, TooManyChecks, attend

_AT_A_TIME: Final = 2
_MOST_WAITING: Final = 16


class UnreadableFiles(Exception):
    """A file of the scene cannot be read at this time."""


@dataclass
class Placing:
    """The scene roots of one API process."""

    roots: tuple[SceneRoot, ...] = ()
    hashes: Path = Path("/dev/null")  #: the table of `FileHashes`
    _slots: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(_AT_A_TIME))
    _admitted: int = 0

    async def bundle(
        self,
        name: str,
        asked: Sequence[Mapping[str, str]],
        limits: BundleLimits,
        is_gone: IsGone,
    ) -> BinaryIO:
        """Return the bundle of the scene of this name, with the files of all sets of parameters.

        Raises
        ------
        BundleError
            The scene is refused.
        UnreadableFiles
            A file of it cannot be read, or changes meanwhile.
        TooManyChecks, Gone
            Too many wait already; the client has disconnected.
        """
        if self._admitted >= _AT_A_TIME + _MOST_WAITING:
            raise TooManyChecks
        self._admitted += 1
        try:
            question = {
                "name": name,
                "asked": [dict(one) for one in asked],
                "roots": [{**asdict(one), "path": str(one.path)} for one in self.roots],
                "hashes": str(self.hashes),
                "limits": asdict(limits),
            }
            work = asyncio.ensure_future(self._made(question))
            try:
                return await attend(work, is_gone)
            finally:
                work.cancel()
        finally:
            self._admitted -= 1

    async def _made(self, question: dict[str, Any]) -> BinaryIO:
        async with self._slots:
            file = cast("BinaryIO", tempfile.TemporaryFile())  # noqa: SIM115  (the caller closes it)
            try:
                await self._fill(file, question)
            except BaseException:
                file.close()
                raise
        return file

    async def _fill(self, file: BinaryIO, question: dict[str, Any]) -> None:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", placing_child.__name__, str(file.fileno())),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            env=plain_environment(),
            pass_fds=(file.fileno(),),
            start_new_session=True,
            preexec_fn=die_with_parent(signal.SIGKILL),
        )
        try:
            said, _ = await process.communicate(json.dumps(question).encode())
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        if process.returncode == -signal.SIGXCPU:
            raise BundleError(
                "xml-too-large",
                f"the scene takes more than {placing_child.FINDING_S} s of CPU time to read; put "
                "geometry into mesh files, and use fewer includes and parameters",
            )
        if process.returncode != 0:
            raise UnreadableFiles(f"reading it ended with exit code {process.returncode}")
        answer = json.loads(said)
        if "error" in answer:
            raise BundleError.told(**answer["error"])
        if "unreadable" in answer:
            raise UnreadableFiles(answer["unreadable"])

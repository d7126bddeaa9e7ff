# SPDX-License-Identifier: Apache-2.0
"""One job of the farm's, from the saved copy of a file to the loaded image.

A thread packs, uploads and asks how the job is. What it learns waits until Blender's main thread
takes it (`Submission.news`): Blender's data may be touched there alone.
"""

import json
import queue
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from .farm import Farm, FarmError, NotThere

#: How long between two questions.
POLL_S = 2.0
#: The farm may be away for so many questions in a row.
_PATIENCE = 60
_LONGEST_LIST = 10


@dataclass(frozen=True)
class News:
    """What a submission has come to.

    Attributes
    ----------
    text : str
        A line for the panel.
    image : Path or None
        An image that has not been shown yet.
    is_result : bool
        Whether it is the linear image of an ended job.
    is_over : bool
        Whether nothing more comes.
    is_error : bool
        Whether the text says what went wrong.
    """

    text: str
    image: Path | None = None
    is_result: bool = False
    is_over: bool = False
    is_error: bool = False


class Submission:
    """A job that is sent and watched.

    Parameters
    ----------
    farm : Farm
        Where it goes.
    scene : Path
        A copy of the Blender file, in a folder that is the submission's own.
    spec : dict
        The job's spec.
    result : Path
        The file for the linear image.
    """

    def __init__(self, farm: Farm, scene: Path, spec: dict[str, Any], result: Path) -> None:
        self._farm, self._scene, self._spec, self._result = farm, scene, spec, result
        self._news: queue.SimpleQueue[News] = queue.SimpleQueue()
        self._left = threading.Event()
        self._cancelled = threading.Event()
        # Known here, since Blender may be asked by its main thread alone.
        self._blender = _blender()
        self._thread = threading.Thread(target=self._run, name="plateau", daemon=True)
        self._thread.start()

    def news(self) -> list[News]:
        """Return what has come since the last call."""
        found = []
        while not self._news.empty():
            found.append(self._news.get())
        return found

    def cancel(self) -> None:
        """Have the job end with the image that it has."""
        self._cancelled.set()

    def leave(self) -> None:
        """Watch no longer; the job goes on."""
        self._left.set()

    def _run(self) -> None:
        try:
            self._tell("packing")
            self._pack()
            if self._cancelled.is_set():
                self._news.put(News("cancelled before it was sent", is_over=True))
                return
            job = self._farm.submit(
                self._scene, self._spec, lambda share: self._tell(f"uploading, {share:.0%}")
            )
            self._watch(job)
        except FarmError as error:
            self._news.put(News(str(error), is_over=True, is_error=True))
        except OSError as error:
            self._news.put(News(f"this machine: {error}", is_over=True, is_error=True))
        except Exception as error:  # noqa: BLE001  (nobody else would hear of it)
            self._news.put(News(f"it failed: {error!r}", is_over=True, is_error=True))

    def _tell(self, text: str) -> None:
        self._news.put(News(text))

    def _pack(self) -> None:
        command = [*self._blender, str(Path(__file__).with_name("pack.py")), str(self._scene)]
        # Blender's program takes what follows -- as the script's.
        if "--python" in command:
            command.insert(-1, "--")
        done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
        try:
            left = next(
                json.loads(line)
                for line in reversed(done.stdout.splitlines())
                if line.startswith("[")
            )
        except (StopIteration, ValueError) as error:
            said = (done.stdout + done.stderr).strip().splitlines() or ["nothing"]
            raise FarmError(f"the file could not be packed; Blender said: {said[-1]}") from error
        if left:
            more = f" and {len(left) - _LONGEST_LIST} more" if len(left) > _LONGEST_LIST else ""
            raise FarmError(
                f"missing, or of a kind that cannot be packed: {', '.join(left[:_LONGEST_LIST])}"
                f"{more}. Save the file in a folder with all that it uses, and send the folder: "
                "plateau submit FOLDER"
            )

    def _watch(self, job: dict[str, Any]) -> None:
        job_id, shown_spp, failures, is_told = job["id"], 0, 0, False
        while not self._left.is_set():
            try:
                if self._cancelled.is_set() and not is_told:
                    if not self._farm.job(job_id)["ended_at"]:
                        self._farm.cancel(job_id)
                    is_told = True
                job = self._farm.job(job_id)
                picture = None
                if job["spp"] > shown_spp and not job["finished_at"]:
                    picture = self._fetched(job_id, "image.png", self._scene.with_name("image.png"))
                    shown_spp = job["spp"] if picture else shown_spp
                failures = 0
                if job["finished_at"]:
                    self._end(job)
                    return
                self._news.put(News(_described(job), picture))
            except NotThere:
                raise
            except FarmError as error:
                failures += 1
                if failures > _PATIENCE:
                    raise
                self._tell(f"{error}; asking again")
            self._left.wait(POLL_S)

    def _end(self, job: dict[str, Any]) -> None:
        text = f"{job['state']}: {job['reason']}"
        is_error = job["state"] == "failed"
        image = self._fetched(job["id"], "image.exr", self._result) if job["spp"] else None
        self._news.put(
            News(text, image, is_result=image is not None, is_over=True, is_error=is_error)
        )

    def _fetched(self, job_id: str, name: str, path: Path) -> Path | None:
        try:
            content = self._farm.image(job_id, name)
        except NotThere:
            return None
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        return path


def _blender() -> list[str]:
    """Return the command that runs a script in another Blender, without the script."""
    program = bpy.app.binary_path
    if program:
        return [program, "--background", "--factory-startup", "--python-exit-code", "1", "--python"]
    return [sys.executable]  # Blender as a Python module


def _described(job: dict[str, Any]) -> str:
    noise = job.get("estimate_fraction")
    left = "" if noise is None else f", noise left {noise:.3%}"
    return f"{job['state']}: {job['spp']} spp{left}" if job["spp"] else str(job["reason"])

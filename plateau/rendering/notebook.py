"""Progress of a job in a Jupyter notebook: the image, the curve and the noise left, live."""

import sys
from typing import Any

from plateau.client import ApiError, Client
from plateau.farm.wire.views import JobView
from plateau.rendering.html import card, headline
from plateau.terminal.progress import Progress


def in_notebook() -> bool:
    """Whether this is the kernel of a notebook, which can show HTML."""
    ipython = sys.modules.get("IPython")
    return hasattr(ipython.get_ipython(), "kernel") if ipython is not None else False


class NotebookProgress(Progress):
    """An output of the cell that changes in place; one line of it stays.

    It needs no widgets, so the cell can be run again, and the saved notebook has it.
    """

    def __init__(self, client: Client) -> None:
        from IPython.display import HTML, display

        super().__init__()
        self._client = client
        self._png: bytes | None = None
        self._shown_spp: int | None = None
        self._notes: list[str] = []
        self._output: Any = display(HTML(""), display_id=True)

    def job(self, job: JobView) -> None:
        """Show the current state of the job, with its newest image."""
        if job.image_spp is not None and job.image_spp != self._shown_spp:
            try:
                self._png, self._shown_spp = self._client.image(job.id), job.image_spp
            except ApiError as error:
                if error.slug != "no-image-yet":
                    raise
        super().job(job)

    def note(self, text: str) -> None:
        """Show a line, until the job has ended."""
        self._notes.append(text)
        self.refresh()

    def refresh(self) -> None:
        """Show all of it again."""
        if self._job is not None:
            self._update(card(self._job, self._points, self._png, *self._notes))

    def __exit__(self, *error: object) -> None:
        if self._job is not None:
            self._update(headline(self._job))

    def _update(self, html: str) -> None:
        from IPython.display import HTML

        self._output.update(HTML(html))

"""What the shell offers when somebody presses Tab.

Each function returns the values that fit, with a word about each. Where the service has to be
asked, it has a second, and silence is an answer: a prompt is no place for an error.

Zsh evaluates what it is offered, and Typer's quoting leaves a gap for backslashes. So of names that
others choose, of scenes and of files, only plain letters get that far.
"""

import re
from pathlib import Path
from typing import Final, get_args

import typer

from plateau import scenes

_PATIENCE_S: Final = 1.0
_MOST_JOBS: Final = 200
_SCHEME: Final = "scenes:"
_SCENE_FILES: Final = frozenset({".xml", ".zip"})
#: Anything else means something to some shell.
_NOT_PLAIN: Final = re.compile(r"[^\w.+-]")

Offered = list[tuple[str, str]]

#: In which states a job is worth offering to a command; to others, in all.
_USEFUL: Final = {
    "cancel": {"queued", "rendering", "paused"},
    "pause": {"rendering"},
    "priority": {"queued", "rendering", "paused"},
    "resume": {"paused"},
}


def job_ids(ctx: typer.Context, incomplete: str) -> Offered:
    """The newest jobs that the command can do something with."""
    try:
        from plateau.commands.connect import connect

        with connect(ctx.params.get("url"), timeout_s=_PATIENCE_S, quiet=True) as client:
            jobs = client.jobs(limit=_MOST_JOBS).jobs
    except Exception:  # noqa: BLE001  (whatever it is, the command itself will say it)
        return []
    useful = _USEFUL.get(ctx.info_name or "")
    return [
        (job.id, f"{job.state.value}, {_NOT_PLAIN.sub('_', job.name)}")
        for job in jobs
        if job.id.isalnum()
        and job.id.startswith(incomplete)
        and (useful is None or job.state.value in useful)
    ]


def scene_files(incomplete: str) -> Offered:
    """Our own scenes and, beside them, what may be a scene in this folder.

    Where none of ours can be meant any more there is nothing to offer, and shells complete paths.
    """
    ours = [(f"{_SCHEME}{name}", "a scene that Plateau brings") for name in scenes.NAMES]
    found = [offer for offer in ours if offer[0].startswith(incomplete)]
    if found and not incomplete.startswith(_SCHEME):
        found += [(f"{path}/", "a folder") for path in _here(incomplete) if path.is_dir()]
        files = (path for path in _here(incomplete) if path.suffix in _SCENE_FILES)
        found += [(str(path), "a scene") for path in files]
    return found


def states(incomplete: str) -> Offered:
    """The states of a job."""
    from plateau.farm.model.states import JobState

    return [(state.value, "") for state in JobState if state.value.startswith(incomplete)]


def rules(incomplete: str) -> Offered:
    """The stopping rules."""
    from plateau.rules import rules as known

    named = [(name, rule.summary) for name, rule in known().items()]
    return [(name, about.rstrip(".")) for name, about in named if name.startswith(incomplete)]


def variants(incomplete: str) -> Offered:
    """The variants of the renderers."""
    from plateau.farm.model.renderers import AnyVariant

    return [(name, "") for name in get_args(AnyVariant) if name.startswith(incomplete)]


def _here(incomplete: str) -> list[Path]:
    hidden = incomplete.startswith(".")
    return sorted(
        path
        for path in Path().iterdir()
        if path.name.startswith(incomplete)
        and not _NOT_PLAIN.search(path.name)
        and (hidden or path.name[0] != ".")
    )

"""Completions for the shell.

Each function returns the matching values, each with a short description. A service that is asked
has one second; if it fails, nothing is offered, since a prompt is no place for an error.

Zsh evaluates the completions, and Typer does not quote backslashes. So special characters in the
names of scenes are replaced. Paths are left to the shell.
"""

import re
from typing import Final

import typer

#: Any other character may be special in some shell.
_NOT_PLAIN: Final = re.compile(r"[^\w.+-]")

Offered = list[tuple[str, str]]

_ENDED: Final = {"converged", "exhausted", "cancelled", "failed"}
#: By command: the states of the jobs that it can change. Other commands take any job.
_USEFUL: Final = {
    "cancel": {"queued", "rendering", "paused"},
    "delete": _ENDED,
    "pause": {"rendering"},
    "priority": {"queued", "rendering", "paused"},
    "resume": {"paused"},
}


def job_ids(ctx: typer.Context, incomplete: str) -> Offered:
    """The newest jobs to which the command applies."""
    try:
        from plateau.commands.connect import connect

        with connect(ctx.params.get("url"), timeout_s=1.0, quiet=True) as client:
            undo = ctx.info_name == "delete" and bool(ctx.params.get("undo"))
            jobs = list(client.all_jobs(limit=200, deleted=undo))
    except Exception:  # noqa: BLE001  (the command itself will report the error)
        return []
    useful = _USEFUL.get(ctx.info_name or "")
    return [
        (job.id, f"{job.outcome}, {_NOT_PLAIN.sub('_', job.name)}")
        for job in jobs
        if job.id.isalnum()
        and job.id.startswith(incomplete)
        and (useful is None or job.state.value in useful)
    ]


def states(incomplete: str) -> Offered:
    """The states of a job."""
    from plateau.farm.model.states import JobState

    return [(state.value, "") for state in JobState if state.value.startswith(incomplete)]


def rules(incomplete: str) -> Offered:
    """The stopping rules."""
    from plateau.rules import rules as known

    named = [(name, rule.help) for name, rule in known().items()]
    return [(name, about.rstrip(".")) for name, about in named if name.startswith(incomplete)]


def variants(incomplete: str) -> Offered:
    """The variants of the renderers."""
    from plateau.farm.model.renderers import AUTO
    from plateau.farm.model.renderers import variants as known

    return [(name, "") for name in (AUTO, *known()) if name.startswith(incomplete)]


def aovs(incomplete: str) -> Offered:
    """The AOVs, with what they are."""
    from plateau.farm.model.aovs import AOVS

    return [(name, aov.meaning) for name, aov in AOVS.items() if name.startswith(incomplete)]


def places(incomplete: str) -> Offered:
    """Where an image is seen."""
    from plateau.farm.model.spec import PLACES, ViewSpec

    named = [(name, ViewSpec(**view).words) for name, view in PLACES.items()]
    return [(name, words) for name, words in named if name.startswith(incomplete)]

"""The monitor: it owns jobs while they run, and ends them.

`turns` says which job is next, `decisions` what is done with it, and `job_run` does it. The room
never imports `plateau.service.api`; what both need is in `plateau.service.judging`.

The reasons are in docs/decisions/merging.md.
"""

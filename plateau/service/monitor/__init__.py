"""The monitor: it owns jobs while they run, and ends them.

`turns` chooses the next job, `decisions` the next step with it, and `job_run` takes the step. The
package never imports `plateau.service.api`; what both need is in `plateau.picture`. The
reasons are in docs/decisions/merging.md and queue.md.
"""

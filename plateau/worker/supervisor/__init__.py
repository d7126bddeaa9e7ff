"""The worker's own process: it leases slices, has a child render them, and uploads the partials.

It never imports a renderer; those run in processes of `plateau.worker.child`.

The reasons are in docs/decisions/worker.md.
"""

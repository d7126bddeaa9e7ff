"""The worker's own process: it leases slices, has them rendered, and uploads what comes of them.

It never imports a renderer; those run in processes of `plateau.worker.child`.

The reasons are in docs/decisions/worker-and-confinement.md.
"""

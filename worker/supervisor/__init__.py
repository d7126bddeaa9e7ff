"""The worker's own process: it leases slices, has them rendered, and uploads what comes of them.

It never imports a renderer; those run in processes of `plateau.worker.child`.
"""

"""What the farm speaks of: jobs, slices, specs and batches, and the errors of `farm`.

Plain values, checked. Nothing here knows Redis, files or the network.
"""

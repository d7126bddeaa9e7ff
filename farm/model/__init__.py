"""What the farm speaks of: jobs, slices, specs, batches and studies, and the errors of `farm`.

Plain values, checked. Nothing here knows Redis, files or the network.
"""

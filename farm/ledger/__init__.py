"""What Redis keeps of a farm: jobs, slices, batches, members, keys, messages.

Each module has the commands of one subject. How Redis is reached is in `plateau.farm.redis`.

The reasons are in docs/decisions/queue-and-leases.md.
"""

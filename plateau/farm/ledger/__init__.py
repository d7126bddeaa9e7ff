"""A farm's records in Redis: jobs, slices, batches, members, keys, messages.

`plateau.farm.redis` has the way to Redis, docs/decisions/queue.md the reasons.
"""

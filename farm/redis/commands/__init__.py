"""The commands of the script in ``farm/redis/lua``: what each is given, and what it answers.

A dataclass stands here for each function of ``lua/commands``, in a module of its file's name (the
lease, a file of its own in Lua, is in `slices`). `plateau.farm.redis.scripts.Scripts` runs them.
What a caller makes of an answer belongs in `plateau.farm.ledger`.
"""

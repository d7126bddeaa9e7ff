"""The commands of the script in ``plateau/farm/redis/lua``: their arguments and answers.

Each function of ``lua/commands`` has a dataclass here, in a module of its file's name (the lease, a
file of its own in Lua, is in `slices`). `plateau.farm.redis.scripts.Scripts` runs them, and
`plateau.farm.ledger` uses their answers.
"""

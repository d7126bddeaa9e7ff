"""Observer studies, from the question to the thresholds: an extension that the rest does not know.

Here is all of it: what a study is, its Redis, its pictures, its routes, its calls, its commands and
its statistics. `plateau.extensions` names it, and nothing else imports it. Its Redis keys and its
Lua are with all others in `plateau.farm.redis`, and its kinds of problem in the API's one list.

The reasons are in docs/decisions/study.md.
"""

"""Observer studies, from the question to the thresholds: an extension of Plateau.

The package has the model of a study, its storage, pictures, routes, client calls, commands and
statistics. Only `plateau.extensions` names it. Its problem types are in the API's list. The
reasons are in docs/decisions/stopping.md.
"""

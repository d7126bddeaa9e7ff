"""What the API finds out for observer studies: levels, pictures and results.

The reasons are in docs/decisions/study.md.
"""

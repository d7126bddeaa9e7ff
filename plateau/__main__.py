"""``python -m plateau``."""

from plateau.commands import main

main()

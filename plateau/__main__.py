"""``python -m plateau``."""

from plateau.cli import main

main()

"""The work of the commands; `plateau.cli` imports each when it is called."""

"""What the commands do; `plateau.cli` imports each when it is called."""

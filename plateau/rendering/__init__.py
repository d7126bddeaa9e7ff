"""From a scene to its results: `plateau.render`, and what it shares with the command line."""

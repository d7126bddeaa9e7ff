"""Text for people on a terminal: progress, stories, tables and curves."""

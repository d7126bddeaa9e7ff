"""What people see on a terminal: progress, tables, curves, and exit codes."""

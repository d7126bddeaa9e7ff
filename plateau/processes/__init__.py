"""The processes of a farm on this machine: settings, data folder, start, watch, stop."""

"""Every performance figure of Plateau, reproducible: `make bench-NAME` runs ``bench/NAME.py``."""

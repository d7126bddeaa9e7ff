"""Clients that put a load on a farm and measure its answers."""

"""Clients that put a load on a farm, and note what they see."""

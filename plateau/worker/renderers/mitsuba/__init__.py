"""Mitsuba 3 as a renderer."""

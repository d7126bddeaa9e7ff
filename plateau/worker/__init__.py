"""Renders slices: a supervisor that never imports Mitsuba, and a render child that does."""

"""What each slice of a job is: its zones, its samples, its round, and when a point is looked at.

Decided from the spec and from the images so far, whoever renders a slice and whenever.
"""

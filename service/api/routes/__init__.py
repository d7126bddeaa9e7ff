"""The paths of the API, a module for each kind of resource.

What they share is in the packages beside this one.
"""

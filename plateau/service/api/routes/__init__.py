"""The routes of the API, a module for each kind of resource; what they share is beside them."""

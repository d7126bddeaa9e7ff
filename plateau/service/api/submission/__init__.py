"""Requests that create jobs: their parts are read, checked and stored."""

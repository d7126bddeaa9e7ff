"""What the API says, in JSON and CSV: shared by the API, the client and the command line.

How it is found out is in `plateau.service.api`.
"""

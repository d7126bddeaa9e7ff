"""The API's answers in JSON and CSV, shared by the API, the client and the command line."""

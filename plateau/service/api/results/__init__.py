"""All that a job has come to, as files together."""

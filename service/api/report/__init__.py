"""A job's report: one page that stands alone."""

"""What the farm is compared with: Mitsuba, uvicorn and the metric alone."""

"""What a request to create a job brings: read, checked and stored."""

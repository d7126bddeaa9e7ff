"""What the API finds out for observer studies: levels, pictures and results."""

"""Files that commands read and write: packed scenes, movies, result folders."""

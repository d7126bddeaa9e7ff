"""Files that commands read and write: packed scenes, result folders."""

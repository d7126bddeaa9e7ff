"""Files that commands read and write: packed scenes and result folders."""

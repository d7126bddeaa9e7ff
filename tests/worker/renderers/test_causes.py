"""What a reason takes of what a renderer or a dying process says."""

from pathlib import Path

from plateau.worker.renderers.causes import first_and_last_words, first_words, without_folders

LINES = [f"line {number} of a long message" for number in range(1000)]


def test_of_a_long_message_the_first_lines_are_told_whole():
    told = first_words("\n".join(LINES)).splitlines()
    assert told[0] == LINES[0]
    assert told[:-1] == LINES[: len(told) - 1]
    assert "log" in told[-1]
    assert first_words("\n".join(LINES[:3])) == "\n".join(LINES[:3])


def test_one_long_line_ends_at_a_word():
    told = first_words("a word " * 1000)
    assert set(told.split()) == {"a", "word", "…"}
    assert len(told) < 700


def test_of_last_words_the_first_and_the_last_are_told():
    told = first_and_last_words("\n".join([*LINES, "LLVM ERROR: Cannot select"])).splitlines()
    assert (told[0], told[-1]) == (LINES[0], "LLVM ERROR: Cannot select")
    assert all(line in LINES or "log" in line for line in told[:-1])
    assert len("\n".join(told)) < 1100


def test_of_a_traceback_the_exception_is_told():
    try:
        Path("/nowhere").read_text()
    except OSError:
        import traceback

        text = traceback.format_exc()
    assert first_and_last_words(f"a warning\n{text}") == (
        "a warning\nFileNotFoundError: [Errno 2] No such file or directory: '/nowhere'"
    )


def test_of_mitsubas_log_the_last_file_and_the_warnings_are_told():
    log = "\x1b[31m2026-11-27 10:12:0{} {} [A] {}\n\x1b[0m".format
    said = log(1, "DEBUG", 'Loading plugin "plugins/ply.so" ..') + log(2, "WARN ", "it is slow")
    said += log(3, "DEBUG", 'Loading mesh from "a.ply" ..') + log(4, "INFO ", "ready")
    assert first_and_last_words(said) == "it was at the file a.ply\nWARN  [A] it is slow"


def test_folders_of_the_machine_are_not_told(tmp_path):
    link = tmp_path / "link"
    (tmp_path / "real").mkdir()
    link.symlink_to(tmp_path / "real")
    said = f"{link}/a.obj, {tmp_path}/real/b.obj and {__file__}"
    assert without_folders(said, [link]) == "a.obj, b.obj and tests/worker/renderers/test_causes.py"

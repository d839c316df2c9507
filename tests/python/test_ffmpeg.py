# SPDX-License-Identifier: Apache-2.0
"""Reading a video without PyAV: the ffmpeg program is limited, and ends with everything that it has started."""

import os
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

from mjsense.recording import ffmpeg


def frames_of(video, options, output, max_bytes):
    with open(video, "rb") as file:
        return ffmpeg.frames_of(video, file.fileno(), options, output, max_bytes)


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """Makes a script the ffmpeg program, and returns a video."""

    def make(body):
        program = tmp_path / "ffmpeg"
        program.write_text(f"#!/bin/sh\n{body}\n")
        program.chmod(0o755)
        monkeypatch.setenv("MJSENSE_FFMPEG", str(program))
        video = tmp_path / "x.mp4"
        video.write_bytes(b"x")
        return video

    return make


def runs(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] not in "ZX"  # it may stay as a zombie
    except OSError:
        return False


def ends(pid):
    end = time.monotonic() + 30
    while runs(pid) and time.monotonic() < end:
        time.sleep(0.01)
    return not runs(pid)


def test_only_this_file_is_opened_as_mp4_or_matroska(fake):
    video = fake('echo "$@"')
    words = frames_of(video, ["-ss", "1"], ["-f", "rawvideo"], 1000).decode().split()
    assert re.fullmatch(
        "-nostdin -v error -ss 1 -protocol_whitelist file -f mov -codec_whitelist h264,ffv1 -threads 1 "
        rf"-i /proc/{os.getpid()}/fd/\d+ -an -sn -dn -f rawvideo -", " ".join(words)
    )  # fmt: skip
    (depth := video.with_suffix(".mkv")).write_bytes(b"x")
    assert "-f matroska " in frames_of(depth, [], [], 1000).decode()


def test_a_flood_of_messages_is_cut(fake):
    video = fake("head -c 50000000 /dev/zero | tr '\\0' x >&2; stat -L -c %F /dev/stderr > $0.kind; echo the end >&2; exit 3")
    with pytest.raises(RuntimeError, match=r"x\.mp4: ffmpeg cannot decode it: .* failed: exit code 3: xxx.*xthe end$") as caught:
        frames_of(video, [], [], 1000)
    assert len(str(caught.value)) < 1000
    assert video.with_name("ffmpeg.kind").read_text() == "fifo\n"


def test_a_flood_of_output_ends_the_program(fake):
    with pytest.raises(RuntimeError, match=r"x\.mp4: .* was killed: it printed more than 1000 bytes"):
        frames_of(fake("head -c 50000000 /dev/zero"), [], [], 1000)


def test_what_it_leaves_behind_ends(fake):
    left = frames_of(fake("sleep 1000 & echo $!"), [], [], 1000)
    assert ends(int(left))


def test_ctrl_c(fake):
    video = fake("echo $$ > $0.pid; exec sleep 1000")
    file = video.with_name("ffmpeg.pid")

    def interrupt():
        while not (file.exists() and file.read_text()):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    # A shell without job control starts programs in the background with SIGINT ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            frames_of(video, [], [], 1000)
    finally:
        thread.join()
        signal.signal(signal.SIGINT, before)
    assert ends(int(file.read_text()))


def test_without_ffmpeg(tmp_path):
    code = "import pathlib; from mjsense.recording.ffmpeg import frames_of; file = open('x.mp4'); frames_of(pathlib.Path('x.mp4'), file.fileno(), [], [], 10)"
    environment = {**os.environ, "PATH": str(tmp_path), "MJSENSE_FFMPEG": str(tmp_path / "none")}
    (tmp_path / "x.mp4").write_bytes(b"")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert "RuntimeError: x.mp4: ffmpeg cannot decode it: cannot start the program" in done.stderr

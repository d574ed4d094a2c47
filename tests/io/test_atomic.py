"""Output is whole or absent, and one process writes it at a time."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import poresynth
from poresynth.errors import FileError
from poresynth.io import check_writable, claim, output

posix = pytest.mark.skipif(os.name != "posix", reason="signals and limits are POSIX")


@contextmanager
def running(code: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Run a program in a folder; it has printed its first line when the block begins."""
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline().strip() == "ready"
            yield process
        finally:
            process.kill()


def test_files_appear_together(tmp_path: Path) -> None:
    a, b = tmp_path / "a.txt", tmp_path / "b.txt"
    with output(a, b) as (new_a, new_b):
        assert new_a.parent == tmp_path
        assert new_a.name.endswith("a.txt")
        new_a.write_text("1")
        new_b.write_text("2")
        assert not a.exists()
        assert not b.exists()
    assert (a.read_text(), b.read_text()) == ("1", "2")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.txt", "b.txt"]


def test_what_is_not_written_stays(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    with output(tmp_path / "a.txt"):
        pass
    assert (tmp_path / "a.txt").read_text() == "old"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, MemoryError, SystemExit])
def test_an_exception_leaves_everything_as_it_was(
    error: type[BaseException], tmp_path: Path
) -> None:
    (tmp_path / "a.txt").write_text("old")

    def fail() -> None:
        with output(tmp_path / "a.txt", tmp_path / "folder") as (new, folder):
            new.write_text("half")
            folder.mkdir()
            (folder / "b.txt").write_text("half")
            raise error

    with pytest.raises(error):
        fail()
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"


def test_folders_replace_only_what_they_may(tmp_path: Path) -> None:
    target = tmp_path / "out"
    target.mkdir()

    def write(text: str, **options: object) -> None:
        with output(target, **options) as (new,):
            new.mkdir()
            (new / text).write_text(text)

    write("first")  # An empty folder may always be replaced.
    with pytest.raises(FileError, match=r"out: the folder exists and holds other files"):
        write("second")
    write("third", may_replace=lambda folder: (folder / "first").exists())
    assert [p.name for p in target.iterdir()] == ["third"]
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_file_does_not_replace_a_folder_nor_a_folder_a_file(tmp_path: Path) -> None:
    a, b = tmp_path / "folder", tmp_path / "file"
    a.mkdir()
    b.touch()
    with pytest.raises(FileError, match="is a folder, not a file"), output(a) as (new,):
        new.touch()
    with pytest.raises(FileError, match="is a file, not a folder"), output(b) as (new,):
        new.mkdir()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def test_what_a_killed_run_left_is_in_nobodys_way(tmp_path: Path) -> None:
    (tmp_path / ".partial-out").mkdir()
    (tmp_path / ".partial-out" / "x").touch()
    (tmp_path / ".partial-a").touch()
    with output(tmp_path / "a", tmp_path / "out") as (a, out):
        assert not a.exists()
        assert not out.exists()
        a.touch()
        out.mkdir()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "out"]


@posix
def test_links_are_written_through(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "a.npy").touch()
    (tmp_path / "link.npy").symlink_to(tmp_path / "real" / "a.npy")
    poresynth.write(tmp_path / "link.npy", np.ones((2, 2, 2)))
    assert (tmp_path / "link.npy").is_symlink()
    assert (tmp_path / "real" / "a.npy").stat().st_size > 0


def test_check_writable_leaves_nothing(tmp_path: Path) -> None:
    check_writable(tmp_path / "a.tif")
    check_writable(tmp_path / "out", folder=True)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FileError, match="does not exist"):
        check_writable(tmp_path / "no" / "a.tif")
    with pytest.raises(FileError, match="is a folder, not a file"):
        check_writable(tmp_path)


def test_long_names(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="the name is too long"):
        poresynth.write(tmp_path / ("n" * 300 + ".npy"), np.ones((2, 2, 2)))


HOLD = """
    import sys, time
    from poresynth.io import claim
    with claim("new.tif"):
        print("ready", flush=True)
        time.sleep(60)
"""


def test_a_second_run_fails_at_once(tmp_path: Path) -> None:
    path = tmp_path / "new.tif"
    with running(HOLD, tmp_path) as other:
        with pytest.raises(FileError) as caught, claim(path):
            pass
        assert str(caught.value) == f"{path}: is being written by process {other.pid}"
        with pytest.raises(FileError, match=f"is being written by process {other.pid}"):
            poresynth.write(path, np.zeros((2, 3, 4), np.uint8))
        with claim(tmp_path / "another.tif"):
            pass
        other.kill()
        other.wait()
        assert (tmp_path / ".new.tif.lock").exists()
        with claim(path):  # The lock of a dead process is taken over.
            assert (tmp_path / ".new.tif.lock").read_text().startswith(f"{os.getpid()} ")
    assert list(tmp_path.iterdir()) == []


@posix
def test_of_many_runs_one_wins(tmp_path: Path) -> None:
    # All start on the lock of a dead process, which they race to take over.
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    (tmp_path / ".new.tif.lock").write_text(f"{dead.pid} {socket.gethostname()}\n")
    code = """
        import sys, time
        from pathlib import Path
        from poresynth.errors import FileError
        from poresynth.io import claim
        while not Path("go").exists():
            time.sleep(0.001)
        try:
            with claim("new.tif"):
                print("won", flush=True)
                while not Path("stop").exists():
                    time.sleep(0.01)
        except FileError:
            print("lost", flush=True)
    """
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(code)],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(4)
    ]
    (tmp_path / "go").touch()
    said = sorted(run.stdout.readline().strip() for run in runs)  # type: ignore[union-attr]
    (tmp_path / "stop").touch()
    for run in runs:
        run.communicate()
    assert said == ["lost", "lost", "lost", "won"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["go", "stop"]


def test_claims_nest_in_a_thread_and_exclude_other_threads(tmp_path: Path) -> None:
    path, said = tmp_path / "new.tif", []

    def other() -> None:
        try:
            with claim(path):
                said.append("claimed")
        except FileError as error:
            said.append(str(error))

    with claim(path), claim(path):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    assert said == [f"{path}: is being written by another thread of this process"]
    other()
    assert said[1] == "claimed"
    assert list(tmp_path.iterdir()) == []


def test_a_lock_of_another_host_is_respected(tmp_path: Path) -> None:
    path, lock = tmp_path / "new.tif", tmp_path / ".new.tif.lock"
    lock.write_text("17 another-host\n")
    said = r"by process 17 on another-host \(if it is gone, remove .*\.new\.tif\.lock\)"
    with pytest.raises(FileError, match=said), claim(path):
        pass
    lock.write_text("")
    with pytest.raises(FileError, match="by another process"), claim(path):
        pass
    lock.write_text(f"{os.getpid()} {socket.gethostname()}\n")
    with claim(path):  # Left by an earlier process of the same number.
        pass


SLICES = """
    import numpy as np, signal, sys, time
    import poresynth
    from poresynth.io import slices
    written = slices.TIFF.write
    def write(path, content):
        written(path, content)
        if path.name == "slice_0005.tif":
            print("ready", flush=True)
            time.sleep(60)
    object.__setattr__(slices.TIFF, "write", write)
    poresynth.write("new", np.zeros((2000, 64, 64), np.uint8))
"""


@posix
@pytest.mark.parametrize(
    ("number", "code"),
    [
        (signal.SIGINT, -signal.SIGINT),
        (signal.SIGTERM, 128 + signal.SIGTERM),
        (signal.SIGHUP, 128 + signal.SIGHUP),
    ],
)
def test_an_interrupted_write_leaves_nothing(number: int, code: int, tmp_path: Path) -> None:
    with running(SLICES, tmp_path) as process:
        partial = tmp_path / ".partial-new"
        assert len(list(partial.iterdir())) == 6
        process.send_signal(number)
        process.wait(30)
        assert process.returncode == code
    assert list(tmp_path.iterdir()) == []


@posix
def test_the_signals_are_as_before(tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGTERM)
    with output(tmp_path / "a"):
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_killed_write_leaves_the_old_file(tmp_path: Path) -> None:
    poresynth.write(tmp_path / "new", np.ones((2, 2, 2), np.uint8))
    with running(SLICES, tmp_path) as process:
        process.kill()
        process.wait()
    np.testing.assert_array_equal(poresynth.read(tmp_path / "new"), np.ones((2, 2, 2)))
    poresynth.write(tmp_path / "new", np.zeros((3, 4, 5), np.uint8))
    assert [p.name for p in tmp_path.iterdir()] == ["new"]


@posix
@pytest.mark.parametrize("suffix", [".tif", ".npy", ".npz", ".raw", ".zarr", "", ".png"])
def test_the_limit_of_a_files_size(suffix: str, tmp_path: Path) -> None:
    code = f"""
        import numpy as np, resource, sys
        import poresynth
        from poresynth.errors import FileError
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
        shape = (1, 1000, 1000)
        array = np.random.default_rng(0).integers(0, 255, shape).astype(np.uint8)
        print("ready", flush=True)
        try:
            poresynth.write("new{suffix}", array)
        except FileError as error:
            print(error)
    """
    with running(code, tmp_path) as process:
        said, errors = process.communicate()
    allowed = "larger than the system allows a file to be|no room left on the disk"
    assert re.fullmatch(f"new{re.escape(suffix)}: ({allowed})\n", said), said + errors
    assert errors == ""
    assert list(tmp_path.iterdir()) == []


@posix
def test_a_disk_without_room_for_the_lock_leaves_none(tmp_path: Path) -> None:
    """An empty lock names nobody: it would stand in the way for ever."""
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1, limits[1]))
    try:
        with pytest.raises(FileError, match=r"new\.tif: "):
            claim(tmp_path / "new.tif").__enter__()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []
    with claim(tmp_path / "new.tif"):
        pass

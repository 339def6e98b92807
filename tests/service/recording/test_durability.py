"""Kills, cuts, flipped bytes: what is read is what was written, up to a point that is told."""

import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frictus_service.errors import RecordingError
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.recovery import recover
from frictus_service.recording.summary import summarise

pytestmark = pytest.mark.long

SCRIPT = Path(__file__).with_name("known.py")
AT_ONCE = 4
"""Recorders that live at the same time."""


@dataclass(frozen=True)
class Told:
    """What a recorder had told before it was killed."""

    handed: int
    synced: int
    synced_bytes: int


def kill_at_random(path: Path, life_s: float) -> Told:
    """Run a recorder for so long after its first sign of life, kill it, and hear it out."""
    command = [sys.executable, str(SCRIPT), str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(life_s)  # the instant of death is what is drawn; nothing is waited for
        process.kill()
        rest = process.stdout.read()
    handed = synced = synced_bytes = 0
    for line in (first + rest).splitlines(keepends=True):
        words = line.split()
        if line.endswith("\n") and words[0] == "handed":
            handed = int(words[1])
        elif line.endswith("\n"):
            synced, synced_bytes = int(words[1]), int(words[2])
    return Told(handed, synced, synced_bytes)


def check_killed(folder: Path, lives_s: Any, read: Any, known: Any, rng: Any) -> float:
    """Kill a recorder per life; return the most that was lost, s."""

    def one(number: int, life_s: float) -> tuple[Path, Told]:
        path = folder / f"killed-{number}.mcap"
        return path, kill_at_random(path, life_s)

    worst_s = 0.0
    with ThreadPoolExecutor(AT_ONCE) as several:
        for path, told in several.map(one, range(len(lives_s)), lives_s):
            found = read(path)
            assert not found.ending.complete
            for count in found.samples.values():
                assert count >= told.synced
                worst_s = max(worst_s, (told.handed - count) / known.RATE_HZ)
            check_power_cut(path, told, read, known, rng)
            path.unlink()
    assert worst_s <= 1.0
    return worst_s


def check_power_cut(path: Path, told: Told, read: Any, known: Any, rng: Any) -> None:
    """Take from a file what the disk was not told to keep, in part or as zeros."""
    content = path.read_bytes()
    kept = int(rng.integers(told.synced_bytes, len(content) + 1))
    for tail in (b"", bytes(len(content) - kept), rng.bytes(len(content) - kept)):
        path.write_bytes(content[:kept] + tail)
        found = read(path)
        for count in found.samples.values():
            assert count >= told.synced
            assert (told.handed - count) / known.RATE_HZ <= 1.0


def check_cuts(whole: Any, cuts: Any, path: Path, read: Any) -> None:
    """Cut a recording at these bytes: what had been closed by then is read."""
    content = whole.content
    for cut in cuts:
        path.write_bytes(content[:cut])
        due = max((samples for size, samples in whole.flushed if size <= cut), default=0)
        try:
            found = read(path)
        except RecordingError:
            assert cut < whole.flushed[0][0], "something had been recorded by then"
            continue
        assert not found.ending.complete
        assert found.ending.clean_bytes <= cut
        assert f"after {found.ending.clean_s:.2f} s" in str(found.ending)
        for count in found.samples.values():
            assert count >= due
            assert found.ending.clean_s == pytest.approx(max(found.samples.values()) / 20_000.0)


def test_killed_recorders_lose_less_than_a_second(
    tmp_path: Path, read: Any, known: Any, rng: np.random.Generator
) -> None:
    check_killed(tmp_path, rng.uniform(0.0, 1.5, 6), read, known, rng)


@pytest.mark.campaign
@pytest.mark.timeout(900)
def test_two_hundred_kills(
    tmp_path: Path, read: Any, known: Any, rng: np.random.Generator
) -> None:
    worst_s = check_killed(tmp_path, rng.uniform(0.0, 3.0, 200), read, known, rng)
    print(f"200 kills: at most {worst_s:.3f} s lost")  # noqa: T201 - what the campaign found


def test_cuts(tmp_path: Path, make_whole: Any, read: Any, rng: np.random.Generator) -> None:
    whole = make_whole(400)
    size = len(whole.content)
    cuts = [0, 1, 8, size - 1, size - 8, *rng.integers(0, size, 40)]
    check_cuts(whole, cuts, tmp_path / "cut.mcap", read)


@pytest.mark.campaign
@pytest.mark.timeout(900)
def test_two_hundred_cuts(
    tmp_path: Path, make_whole: Any, read: Any, rng: np.random.Generator
) -> None:
    whole = make_whole(4_000)
    cuts = rng.integers(0, len(whole.content), 200)
    check_cuts(whole, cuts, tmp_path / "cut.mcap", read)


def test_flipped_bits(
    tmp_path: Path, make_whole: Any, read: Any, rng: np.random.Generator
) -> None:
    whole = make_whole(300)
    path = tmp_path / "flipped.mcap"
    content = whole.content
    for place in rng.integers(0, 8 * len(content), 100):
        flipped = bytearray(content)
        flipped[place // 8] ^= 1 << (place % 8)
        path.write_bytes(flipped)
        try:
            found = read(path)
        except RecordingError:
            continue  # before anything was recorded
        assert not found.ending.complete, f"bit {place} flipped, and nobody noticed"


def test_zeroed_doubled_and_missing_stretches(
    tmp_path: Path, make_whole: Any, read: Any, rng: np.random.Generator
) -> None:
    whole = make_whole(300)
    path = tmp_path / "changed.mcap"
    content = whole.content
    ends = [size for size, _ in whole.flushed]
    cases = []
    for _ in range(30):
        begin, end = sorted(rng.integers(0, len(content), 2))
        cases.append(content[:begin] + bytes(end - begin) + content[end:])
        # Whole chunks are gone, come twice, or have changed places: each is sound by itself.
        first, second, third = sorted(rng.choice(ends, 3, replace=False))
        one, two = content[first:second], content[second:third]
        cases.append(content[:first] + content[second:])
        cases.append(content[:second] + one + content[second:])
        cases.append(content[:first] + two + one + content[third:])
    for changed in cases:
        path.write_bytes(changed)
        if changed == content:
            continue
        try:
            found = read(path)
        except RecordingError:
            continue
        assert not found.ending.complete


def test_recovered_recording_is_finished_and_holds_what_could_be_read(
    tmp_path: Path, make_whole: Any, read: Any, rng: np.random.Generator
) -> None:
    whole = make_whole(300)
    torn, mended = tmp_path / "torn.mcap", tmp_path / "mended.mcap"
    first = whole.flushed[0][0]
    for cut in rng.integers(first, len(whole.content), 5):
        torn.write_bytes(whole.content[:cut])
        before = read(torn)
        lost = recover(torn, mended)
        assert lost.ending == before.ending
        after = read(mended)
        assert after.ending.complete
        assert (after.samples, after.touches) == (before.samples, before.touches)
        with RecordingReader(mended) as reader:
            summary = summarise(reader)
        assert summary.sound
        with RecordingReader(torn) as reader:
            told = summarise(reader).end  # where the cut left it
        assert summary.end is not None
        assert (told.reason if told else "torn.mcap") in summary.end.reason
        mended.unlink()


def test_nothing_to_recover(tmp_path: Path, make_whole: Any) -> None:
    whole = make_whole(10)
    with pytest.raises(RecordingError, match="complete"):
        recover(whole.path, tmp_path / "mended.mcap")
    (tmp_path / "empty.mcap").write_bytes(b"")
    with pytest.raises(RecordingError, match=r"empty\.mcap"):
        recover(tmp_path / "empty.mcap", tmp_path / "mended.mcap")
    assert not (tmp_path / "mended.mcap").exists()


def test_any_bytes_are_refused_or_end_early(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "any.mcap"
    for size in (0, 1, 7, 8, 9, 100, 5_000):
        for begin in (b"", b"\x89MCAP0\r\n"):
            path.write_bytes(begin + rng.bytes(size))
            with pytest.raises(RecordingError):
                RecordingReader(path)

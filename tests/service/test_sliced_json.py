"""JSON read in slices: what comes out, and how long other threads wait for the interpreter."""

import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pydantic_core
import pytest
from hypothesis import given
from hypothesis import strategies as st

from frictus_service import json_text
from frictus_service.json_text import SLICE_CHARACTERS, read_sliced

DOCUMENTS = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text('a,]["{}\\'),
    lambda inner: st.lists(inner, max_size=30) | st.dictionaries(st.text("k]},"), inner),
    max_leaves=60,
)
TICK_S = 5e-4


@given(
    document=DOCUMENTS, slice_characters=st.integers(2, 40), indent=st.sampled_from([None, 1])
)
def test_it_reads_what_is_written(
    document: Any, slice_characters: int, indent: int | None
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(json_text, "SLICE_CHARACTERS", slice_characters)
        assert read_sliced(json.dumps(document, indent=indent).encode()) == document


@given(text=st.text('[]{}",:1 e-', max_size=30), slice_characters=st.integers(2, 10))
def test_it_refuses_what_is_no_json(text: str, slice_characters: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(json_text, "SLICE_CHARACTERS", slice_characters)
        try:
            document = json.loads(text)
        except ValueError:
            with pytest.raises(ValueError, match=r"\S"):
                read_sliced(text.encode())
        else:
            assert read_sliced(text.encode()) == document


@pytest.mark.parametrize("payload", [b"[" * 9_000, b'{"x":' * 9_000, b"\xff", b""])
def test_what_cannot_be_read_is_a_value_error(payload: bytes) -> None:
    with pytest.raises(ValueError, match=r"\S"):
        read_sliced(payload)


@pytest.mark.parametrize("half", [r"\ud800", r"\udfff", r"\udc00\ud800"])
@pytest.mark.parametrize(
    "document", ['"@"', '{"@":1}', '{"a":{"b@":[]}}', '["a,]@"]', '[{"a":["x,]","@"]}]']
)
def test_text_that_nobody_could_write_again_is_refused(document: str, half: str) -> None:
    with pytest.raises(ValueError, match="surrogates"):
        read_sliced(document.replace("@", half).encode())
    whole = document.replace("@", r"\ud83d\ude00")
    assert read_sliced(whole.encode()) == json.loads(whole)


def test_the_fast_parser_takes_slices_only(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = []

    def parse(text: str) -> Any:
        sizes.append(len(text))
        return pydantic_core.from_json(text)

    monkeypatch.setattr(json_text, "from_json", parse)
    numbers = [0.1234567890123456] * 140_000
    assert read_sliced(json.dumps({"a": {"b": numbers}}).encode()) == {"a": {"b": numbers}}
    assert len(sizes) > 100
    assert max(sizes) <= SLICE_CHARACTERS + 2


@pytest.fixture
def short_turns() -> Iterator[None]:
    """Threads change as often as in the rig's process."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(2e-4)
    yield
    sys.setswitchinterval(before_s)


def longest_wait_s(work: Callable[[], object]) -> float:
    """Return how long a thread that ticks has waited at most, while another works."""
    done, ticking = threading.Event(), threading.Event()
    waits: list[float] = []

    def tick() -> None:
        last = time.perf_counter()
        while not done.is_set():
            time.sleep(TICK_S)
            last, before = time.perf_counter(), last
            waits.append(last - before)
            ticking.set()

    thread = threading.Thread(target=tick)
    thread.start()
    ticking.wait()
    read = work()
    done.set()
    thread.join()
    del read  # which takes its time, too
    return max(waits)


@pytest.mark.usefixtures("short_turns")
def test_other_threads_run_while_a_long_list_is_read() -> None:
    payload = b"[%b1]" % (b"1.5," * 700_000)
    whole_s = min(longest_wait_s(lambda: pydantic_core.from_json(payload)) for _ in range(7))
    sliced_s = min(longest_wait_s(lambda: read_sliced(payload)) for _ in range(7))
    assert sliced_s < whole_s / 2.0

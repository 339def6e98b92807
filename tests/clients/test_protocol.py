"""`docs/protocol.md` says what the code does."""

import re
from pathlib import Path

import numpy as np
import pytest

from frictus.block import HEADER as BLOCK_HEADER
from frictus.block import Block
from frictus.protocol import EXAMPLE_BLOCK, EXAMPLE_FRAME, main, sections
from frictus.stream import HEADER as FRAME_HEADER
from frictus.stream import StreamFrame

DOCUMENT = (Path(__file__).parents[2] / "docs" / "protocol.md").read_text(encoding="utf-8")
STRUCT_TYPES = {"u16": "H", "u32": "I", "u64": "Q", "i64": "q", "f64": "d"}


@pytest.mark.parametrize("title", sections())
def test_the_document_holds_what_the_code_prints(title: str) -> None:
    assert f"### {title}\n\n{sections()[title]}\n" in DOCUMENT, (
        "replace the generated tables by what `uv run python -m frictus.protocol` prints"
    )


def test_the_command_prints_every_section(capsys: pytest.CaptureFixture[str]) -> None:
    main()
    printed = capsys.readouterr().out
    assert all(body in printed for body in sections().values())


def test_the_vectors_read_and_write_as_the_document_says() -> None:
    block_hex, frame_hex = re.findall(r"```hex\n(.*?)```", DOCUMENT, re.DOTALL)
    block = Block.unpack(bytes.fromhex(block_hex))
    assert block.pack() == bytes.fromhex(block_hex)
    for name in Block.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(block, name), getattr(EXAMPLE_BLOCK, name))
    frame = StreamFrame.unpack(bytes.fromhex(frame_hex))
    assert frame.pack() == bytes.fromhex(frame_hex)
    for name in StreamFrame.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(frame, name), getattr(EXAMPLE_FRAME, name))


@pytest.mark.parametrize(
    ("title", "header"), [("Block, 64", BLOCK_HEADER), ("Stream frame, 64", FRAME_HEADER)]
)
def test_the_header_tables_are_the_structs(title: str, header: object) -> None:
    part = DOCUMENT.split(f"## {title}")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (\d+) \| (\d+) \| (\w+) \|", part, re.MULTILINE)
    offset, layout = 0, "<"
    for start, size, kind in rows:
        assert int(start) == offset
        offset += int(size)
        layout += f"{size}s" if kind == "bytes" else STRUCT_TYPES[kind]
    assert header.format == layout  # type: ignore[attr-defined]
    assert header.size == offset == 64  # type: ignore[attr-defined]

"""Bytecode is kept where Python looks for it."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from frictus_service.cli.checks.doctor import keep_bytecode


def module_of(source: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(source.stem, source)
    assert spec is not None
    return importlib.util.module_from_spec(spec)


def test_bytecode_is_kept_where_python_would_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path / "kept"))
    source = tmp_path / "some_module.py"
    source.write_text("ANSWER = 42\n")
    module = module_of(source)
    kept = Path(importlib.util.cache_from_source(str(source)))
    assert not kept.exists()
    assert keep_bytecode([module, sys, ModuleType("made")]) == 1
    assert kept.exists()
    assert keep_bytecode([module]) == 0  # it is there


def test_what_cannot_be_written_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "kept").write_text("a file, where a folder is due")
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path / "kept"))
    source = tmp_path / "some_module.py"
    source.write_text("ANSWER = 42\n")
    module = module_of(source)
    with pytest.raises(OSError, match="kept"):
        keep_bytecode([module])

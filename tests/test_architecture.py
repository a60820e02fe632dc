"""The plan in docs/architecture.md is that of the code, and imports run one way."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib

import pytest

from tests.support.paths import ROOT

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
RUN = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(sys.argv[1], no_cache=True))"


def lint(config):
    path = f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / 'cli')!r}]; "
    return subprocess.run(
        [sys.executable, "-c", path + RUN, str(config)], capture_output=True, text=True, timeout=300, check=False
    )


def layers():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    return next(contract["layers"] for contract in contracts if contract.get("containers") == ["circlepose"])


def test_imports_run_one_way():
    pytest.importorskip("importlinter")
    done = lint(ROOT / "pyproject.toml")
    assert done.returncode == 0, done.stdout


def test_an_import_against_the_layers_is_found(tmp_path):
    pytest.importorskip("importlinter")
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    broken = text.replace('    "pipeline",\n    "boards",\n', '    "boards",\n    "pipeline",\n')
    assert broken != text
    (tmp_path / "pyproject.toml").write_text(broken, encoding="utf-8")
    done = lint(tmp_path / "pyproject.toml")
    assert done.returncode == 1
    assert "circlepose.boards is not allowed to import circlepose.pipeline" in done.stdout or (
        "circlepose.pipeline is not allowed to import circlepose.boards" in done.stdout
    )


def test_the_page_lists_every_room_once_in_the_order_of_the_layers():
    rows = re.findall(r"^\| ((?:`[\w/.]+`(?:, )?)+) \|", PAGE.split("The command line is a package")[0], re.MULTILINE)
    shown = [name.strip("/").removesuffix(".py") for row in rows for name in re.findall(r"`([\w/.]+)`", row)]
    listed = [name.strip() for layer in layers() for name in layer.split("|")]
    assert shown == listed


def test_the_page_lists_every_room_of_the_command_line():
    part = PAGE.split("The command line is a package")[1].split("## The layers")[0]
    rooms = {
        path.name for path in (ROOT / "cli" / "circlepose_cli").iterdir() if path.suffix == ".py" or path.is_dir()
    }
    rooms -= {"__init__.py", "__pycache__"}
    assert {name.strip("/") for name in re.findall(r"`([a-z]+(?:/|\.py))`", part)} >= rooms


def test_every_file_that_the_page_names_is_there():
    named = set(re.findall(r"`((?:circlepose|cli|configs|docs|tests)/[\w/.]*)`", PAGE))
    assert len(named) > 40
    missing = sorted(name for name in named if not (ROOT / name).exists())
    assert not missing


def test_every_module_that_the_estimators_page_names_is_there():
    text = (ROOT / "docs" / "estimator.md").read_text(encoding="utf-8")
    named = {name for name in re.findall(r"`((?:\w+/)+\w+)`", text) if (ROOT / "circlepose" / name).parent.exists()}
    rooms = {name.split("/")[0] for name in re.findall(r"`((?:\w+/)+\w+)`", text)}
    assert rooms <= {path.name for path in (ROOT / "circlepose").iterdir()} | {"docs", "tests"}
    assert len(named) > 6
    assert [name for name in named if not (ROOT / "circlepose" / f"{name}.py").exists()] == []

"""`check --format github`: what GitHub Actions makes annotations and a step summary of, and the workflow to copy."""

from __future__ import annotations

import re
import shlex
from html import unescape

import numpy as np
import pytest
import yaml

from circlepose.io.tables.paper_layouts import write_results
from circlepose.results import ImageResult, Status
from tests.support.discs import CENTER_MM, made_circle, made_result
from tests.support.paths import ROOT

COMMAND = re.compile(r"::(error|warning) ((?:\w+=[^:,\r\n]*)(?:,\w+=[^:,\r\n]*)*)::([^\r\n]*)")


@pytest.fixture
def summary_file(tmp_path, monkeypatch):
    path = tmp_path / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(path))
    return path


def table(path, images, shift=0.0):
    results = [
        made_result(made_circle(center=CENTER_MM + np.array([0.0, 0.0, shift * (1 + number)])), image=image)
        if image
        else ImageResult("failed.png", Status.NO_CIRCLE, "nothing")
        for number, image in enumerate(images)
    ]
    with path.open("w") as handle:
        write_results(results, handle, data_format="csv", layout="poses")
    return path


def unescaped(text):
    for code, character in (("%3A", ":"), ("%2C", ","), ("%0A", "\n"), ("%0D", "\r"), ("%25", "%")):
        text = text.replace(code, character)
    return text


def annotations(out):
    """Level, properties and message of each line, as GitHub reads them; every line must be one."""
    found = [COMMAND.fullmatch(line) for line in out.splitlines()]
    assert all(found), out
    return [
        (
            match[1],
            {key: unescaped(value) for key, value in (each.split("=", 1) for each in match[2].split(","))},
            unescaped(match[3]),
        )
        for match in found
    ]


def test_poses_that_moved_are_annotations_the_worst_first(run, tmp_path, summary_file):
    poses = table(tmp_path / "poses.csv", ["a.png", "b.png", "new.png"], 1.0)
    baseline = table(tmp_path / "baseline.csv", ["a.png", "b.png", "gone.png"])
    code, out, err = run("check", poses, "--against", baseline, "--format", "github")
    assert code == 4
    assert [(level, properties["file"], properties["title"]) for level, properties, _ in annotations(out)] == [
        ("error", "gone.png", "circlepose check - missing"),
        ("error", "new.png", "circlepose check - extra"),
        ("error", "b.png", "circlepose check - moved"),
        ("error", "a.png", "circlepose check - moved"),
    ]
    assert annotations(out)[2][2] == (
        "b.png, target 0, circle disc, method chen-huang: moved by 2 mm and 0 deg (4 tolerances)"
    )
    assert "2 circles compared; outside 0.5 mm and 0.1 deg: 1 missing, 1 extra, 2 moved" in err
    rows = rows_of(summary_file)
    assert [row[0] for row in rows] == ["image", "gone.png", "new.png", "b.png", "a.png"]
    assert rows[3] == ["b.png", "0", "disc", "chen-huang", "moved", "4.00", "2.000", "0.000", ""]
    assert rows[1][-1] == "ok -> none"


def rows_of(path):
    """The cells of a Markdown table, as they are shown."""
    lines = [line for line in path.read_text().splitlines() if line.startswith("|") and "|---|" not in line]
    rows = [[unescape(cell.strip()) for cell in line.strip("|").split("|")] for line in lines]
    assert len({len(row) for row in rows}) <= 1
    return rows


def test_what_agrees_has_a_summary_but_no_annotation(run, tmp_path, summary_file):
    summary_file.write_text("of another command\n")
    poses = table(tmp_path / "poses.csv", ["a.png"])
    code, out, _ = run("check", poses, "--against", poses, "--format", "github")
    assert (code, out) == (0, "")
    text = summary_file.read_text()
    assert text.startswith("of another command\n### circlepose check\n")
    assert "1 circle compared; all within 0.5 mm and 0.1 deg" in unescape(text)
    assert rows_of(summary_file) == []


def test_no_more_annotations_than_are_shown(run, tmp_path, summary_file):
    names = [f"{number}.png" for number in range(250)]
    poses, baseline = table(tmp_path / "poses.csv", names, 1.0), table(tmp_path / "baseline.csv", names)
    for count in (10, 11, 250):
        one = table(tmp_path / "few.csv", names[:count], 1.0)
        _, out, _ = run("check", one, "--against", table(tmp_path / "some.csv", names[:count]), "--format", "github")
        found = annotations(out)
        assert len(found) == 10
        assert ("more differences" in found[-1][2]) == (count > 10)
        assert count <= 10 or found[-1][2].startswith(f"{count - 9} more differences")
    summary_file.unlink()
    assert run("check", poses, "--against", baseline, "--format", "github")[0] == 4
    assert len(rows_of(summary_file)) == 201
    assert "50 more differences are left out" in summary_file.read_text()


@pytest.mark.parametrize(
    "name",
    [
        "a,b:c.png",
        "100%.png",
        "%0A::error::x.png",
        "a\n::error::b.png",
        "a\r.png",
        "\x1b[31m.png",
        "<script>|`a`*b*_c_[d](e).png",
        "café µ.png",
        "$'a.png",
        "\u2028a.png",
    ],
)
def test_names_of_any_kind_stay_names(run, tmp_path, summary_file, name):
    poses, baseline = (table(tmp_path / f"{shift}.csv", [name], shift) for shift in (1.0, 0.0))
    code, out, _ = run("check", poses, "--against", baseline, "--format", "github")
    assert code == 4
    ((level, properties, message),) = annotations(out)
    shown = properties["file"]
    assert (level, message.split(", target 0")[0]) == ("error", shown)
    assert shown.isprintable()
    if name.isprintable() and not name.startswith("$'"):
        assert shown == name
    assert rows_of(summary_file)[1][0] == shown
    assert not set("<>`*[]") & set(summary_file.read_text().replace("### circlepose check", ""))


@pytest.mark.parametrize("data_format", ["csv", "json", "table"])
def test_nothing_is_written_for_github_unless_asked(run, tmp_path, summary_file, data_format):
    poses, baseline = table(tmp_path / "poses.csv", ["a.png"], 1.0), table(tmp_path / "baseline.csv", ["a.png"])
    _, out, _ = run("check", poses, "--against", baseline, "--format", data_format)
    assert "::" not in out
    assert not summary_file.exists()


def test_elsewhere_there_is_no_summary(run, tmp_path, monkeypatch):
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    poses, baseline = table(tmp_path / "poses.csv", ["a.png"], 1.0), table(tmp_path / "baseline.csv", ["a.png"])
    before = sorted(tmp_path.iterdir())
    code, out, _ = run("check", poses, "--against", baseline, "--format", "github")
    assert (code, len(annotations(out))) == (4, 1)
    assert sorted(tmp_path.iterdir()) == before


def test_a_summary_that_cannot_be_written_does_not_change_the_verdict(run, tmp_path, monkeypatch):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "gone" / "summary.md"))
    poses, baseline = table(tmp_path / "poses.csv", ["a.png"], 1.0), table(tmp_path / "baseline.csv", ["a.png"])
    for reference, expected in ((baseline, 4), (poses, 0)):
        code, _, err = run("check", poses, "--against", reference, "--format", "github")
        assert code == expected
        assert "summary.md cannot be written (No such file or directory); there is no step summary" in err


@pytest.mark.parametrize("overwritten", ["poses.csv", "baseline.csv"])
def test_a_summary_is_not_appended_to_a_table(run, tmp_path, monkeypatch, overwritten):
    poses, baseline = table(tmp_path / "poses.csv", ["a.png"], 1.0), table(tmp_path / "baseline.csv", ["a.png"])
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / overwritten))
    before = (tmp_path / overwritten).read_bytes()
    code, out, err = run("check", poses, "--against", baseline, "--format", "github")
    assert (code, out) == (2, "")
    assert "would be overwritten" in err
    assert (tmp_path / overwritten).read_bytes() == before


def test_a_baseline_that_is_updated_gets_warnings(run, tmp_path, summary_file):
    poses, baseline = table(tmp_path / "poses.csv", ["a.png"], 1.0), table(tmp_path / "baseline.csv", ["a.png"])
    code, out, _ = run("check", poses, "--against", baseline, "--format", "github", "--update")
    assert (code, [level for level, *_ in annotations(out)]) == (0, ["warning"])


def test_a_failed_image_is_named_with_its_statuses(run, tmp_path, summary_file):
    poses, baseline = (
        table(tmp_path / "poses.csv", ["a.png", ""]),
        table(tmp_path / "baseline.csv", ["a.png", "failed.png"]),
    )
    _, out, _ = run("check", poses, "--against", baseline, "--format", "github")
    assert [message for *_, message in annotations(out)] == [
        "failed.png, target 0, circle disc, method chen-huang: missing in the poses; the reference has ok"
    ]
    assert rows_of(summary_file)[1][-1] == "ok -> no_circle"


def workflow():
    (text,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "ci.md").read_text(encoding="utf-8"), re.DOTALL)
    return yaml.safe_load(text)


def test_the_workflow_to_copy_runs(run, folder, tmp_path, monkeypatch, summary_file):
    """Its commands, in a repository as the page describes it."""
    regression = tmp_path / "regression"
    regression.mkdir()
    folder.rename(regression / "imgs")
    (regression / "imgs" / "camera.yaml").rename(regression / "cam.yaml")
    monkeypatch.chdir(tmp_path)
    (job,) = workflow()["jobs"].values()
    commands = [shlex.split(step["run"]) for step in job["steps"] if "run" in step]
    assert [command[:2] for command in commands] == [
        ["python", "-m"],
        ["circlepose", "estimate"],
        ["circlepose", "check"],
    ]
    estimate, check = (command[1:] for command in commands[1:])
    assert run(*estimate)[0] == 0
    (tmp_path / "poses.csv").rename(regression / "baseline.csv")
    assert run(*estimate)[0] == 0
    assert run(*check)[:2] == (0, "")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary_file))
    assert run(*estimate, "--radius-mm", "21")[0] == 0
    code, out, _ = run(*check)
    assert (code, len(annotations(out))) == (4, 2)
    assert len(rows_of(summary_file)) == 3
    kept = job["steps"][-1]
    assert kept["if"] == "failure()"
    assert all((tmp_path / path).exists() for path in kept["with"]["path"].split())

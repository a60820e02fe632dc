"""A scene file to a folder of images with their truth, camera and target."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable
from pathlib import Path

from circlepose.board_result import quaternion_of
from circlepose.errors import OutputError
from circlepose.io.atomic import atomic_writer, refuse_foreign
from circlepose.io.calibration.reader import write_camera
from circlepose.io.images.reader import write_image
from circlepose.io.output_conflicts import Outputs
from circlepose.io.scenes.reader import read_scenes
from circlepose.io.tables.columns import QUATERNION, csv_cell
from circlepose.io.target_file import write_target
from circlepose.synthesis.render import BoardTruthRow, TruthRow, board_truth_rows, render, truth_rows

TRUTH_COLUMNS = (
    "image",
    "instance",
    "circle",
    "radius_mm",
    "center_x_mm",
    "center_y_mm",
    "center_z_mm",
    "normal_x",
    "normal_y",
    "normal_z",
)
# Columns of the layout `boards`. Without `solution` and `chosen` the table is a truth.
BOARD_TRUTH_COLUMNS = ("image", "instance", "x_mm", "y_mm", "z_mm", *QUATERNION, "circles_in_layout")


def render_to_folder(
    scene_path: str | os.PathLike[str], output_dir: str | os.PathLike[str], *, overwrite: bool = False
) -> list[Path]:
    """Render all images of a scene file into `output_dir`, which is made if it is not there.

    Returns the files written: the images (`NAME.png`) in the file's order, `camera.yml` (OpenCV's form),
    `target.yaml` (unless the scenes hold no target), `truth.csv`, and `truth_boards.csv` where there are boards.
    Raises `SceneError` and its relatives on a file that cannot be meant, and `OutputError` where a file of one of
    these names is there that was not written by circlepose, unless `overwrite`; both before anything is written.
    """
    description = read_scenes(scene_path)
    folder = Path(output_dir)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{folder}: cannot be made a folder ({reason.strerror}).") from None
    images = [folder / f"{scene.name}.png" for scene in description.scenes]
    names = ("camera.yml", "target.yaml", "truth.csv", "truth_boards.csv")
    camera, target, truth, truth_of_boards = (folder / name for name in names)
    boards = [row for scene in description.scenes for row in board_truth_rows(scene)]
    written = [*images, camera, *([] if description.target is None else [target]), truth]
    written += [truth_of_boards] if boards else []
    Outputs(written).refuse(Path(scene_path), "the scenes")
    for path in written:
        refuse_foreign(path, overwrite=overwrite)
    for path, scene in zip(images, description.scenes, strict=True):
        write_image(path, render(scene), overwrite=overwrite)
    write_camera(description.camera, camera, overwrite=overwrite)
    if description.target is not None:
        write_target(description.target, target, overwrite=overwrite)
    write_truth((row for scene in description.scenes for row in truth_rows(scene)), truth, overwrite=overwrite)
    if boards:
        write_board_truth(boards, truth_of_boards, overwrite=overwrite)
    return written


def write_truth(rows: Iterable[TruthRow], path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write true poses as CSV with `TRUTH_COLUMNS`, mm, camera frame; raises `OutputError`."""
    with atomic_writer(path, overwrite=overwrite) as handle:
        table = csv.writer(handle, lineterminator="\n")
        table.writerow(TRUTH_COLUMNS)
        for row in rows:
            circle = row.circle
            table.writerow(
                [
                    csv_cell("image", f"{row.image}.png"),
                    row.instance,
                    circle.name,
                    f"{circle.radius:.6f}",
                    *(f"{value:.6f}" for value in circle.center),
                    *(f"{value:.9f}" for value in circle.normal),
                ]
            )


def write_board_truth(
    rows: Iterable[BoardTruthRow], path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """Write true poses of boards as CSV with `BOARD_TRUTH_COLUMNS`, mm, board to camera; raises `OutputError`."""
    with atomic_writer(path, overwrite=overwrite) as handle:
        table = csv.writer(handle, lineterminator="\n")
        table.writerow(BOARD_TRUTH_COLUMNS)
        for row in rows:
            board = row.board
            values = (
                f"{row.image}.png",
                row.instance,
                *board.translation.tolist(),
                *quaternion_of(board.rotation).tolist(),
                len(board.layout),
            )
            table.writerow([csv_cell(*each) for each in zip(BOARD_TRUTH_COLUMNS, values, strict=True)])

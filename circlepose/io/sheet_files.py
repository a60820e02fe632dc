"""A target file to its sheets, and to the target file beside them."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import yaml

from circlepose._version import __version__
from circlepose.errors import CircleposeError, OutputError, TargetError, UsageError
from circlepose.io.atomic import atomic_writer, refuse_foreign
from circlepose.io.marks import COMMENT, bears_mark, with_plot_mark
from circlepose.io.output_conflicts import Outputs
from circlepose.io.print_scale import PrintScale
from circlepose.io.target_file import read_drawn_target, target_to_mapping
from circlepose.io.text.escaping import printable
from circlepose.sheets import FORMS, Form
from circlepose.sheets.code import MOST_BYTES, code_of, has_segno
from circlepose.sheets.dxf import dxf_of, require_dxf
from circlepose.sheets.figure import figure_of
from circlepose.sheets.furniture import Code
from circlepose.sheets.letters import plain_letters
from circlepose.sheets.marking import is_roll_ambiguous, with_roll_settled
from circlepose.sheets.pages import lay_out
from circlepose.sheets.pdf import pdf_of, require_pdf
from circlepose.sheets.shapes import Page, Sheet
from circlepose.sheets.svg import svg_of
from circlepose.sheets.words import described, names_words, small_print
from circlepose.targets.target import Target

_LARGEST_FILE = 1_000_000
_REQUIRE: dict[Form, Callable[[], None]] = {"svg": lambda: None, "pdf": require_pdf, "dxf": require_dxf}


@dataclass(frozen=True, slots=True)
class PrintOptions:
    """How a target is printed."""

    paper_mm: tuple[float, float] | None = None
    """width and height; None for one page as large as needed"""
    is_dark_on_light: bool | None = None
    """None: as the target's polarity says, dark on light where it is `any`"""
    copies: int | None = None
    """discs or rings on the sheet; None for the target's count"""
    marks: bool = True
    """whether a board whose roll is ambiguous gets a mark"""
    code: bool = True
    """whether the target stands on the sheet as a QR code"""
    overwrite: bool = False


@dataclass(frozen=True, slots=True)
class Printed:
    """What was written."""

    sheets: tuple[Path, ...]
    target_file: Path
    target: Target
    """that of `target_file`"""
    pages: int
    remarks: tuple[str, ...]
    """sentences for a person"""


def print_target(
    target_path: str | os.PathLike[str], output: str | os.PathLike[str], options: PrintOptions | None = None
) -> Printed:
    """Draw the target of a file in true size, and write the target file that fits the sheet beside it.

    Parameters
    ----------
    target_path
        A target file.
    output
        The sheet, which ends in .svg, .pdf or .dxf. Where it has several pages, an SVG is written for each:
        `NAME-1.svg` and so on; a PDF has all of them. The target file is `NAME.yaml`.
    options
        How it is printed; None for the defaults.

    Returns
    -------
    The files, and remarks for a person.

    Raises
    ------
    TargetError
        For a target that cannot be printed.
    UsageError
        For an ending that is not known, a paper that is too small, a package that is missing, or an output that is
        the target file itself.
    OutputError
        Where a file is there that circlepose did not write, or that was edited, unless `overwrite`.
    """
    require_form(output)
    drawn, scale = read_drawn_target(target_path)
    try:
        return print_drawn(drawn, output, options, name=Path(target_path).name, source=Path(target_path), scale=scale)
    except TargetError as error:
        raise TargetError(f"{os.fspath(target_path)}: {error}") from None


def require_form(output: str | os.PathLike[str]) -> None:
    """Raise `UsageError` for a sheet whose ending is not known, or needs a package that is missing."""
    _REQUIRE[_form_of(Path(output))]()


def print_drawn(
    drawn: Target,
    output: str | os.PathLike[str],
    options: PrintOptions | None = None,
    *,
    name: str,
    source: Path | None = None,
    scale: PrintScale | None = None,
) -> Printed:
    """Draw a target as `print_target` does; `name` is what the sheet calls it, `source` the file that it is from."""
    options = options or PrintOptions()
    path = Path(output)
    form = _form_of(path)
    remarks: list[str] = []
    target = _as_printed(drawn, options, remarks)
    is_dark_on_light = target.polarity == "dark"
    target_file = path.with_suffix(".yaml")
    mapping = _in_lines(target_to_mapping(target))
    copies = options.copies or target.count or 1
    factors = (1.0, 1.0) if scale is None else (1.0 / scale.x, 1.0 / scale.y)
    figure = figure_of(target, copies if target.layout is None else None)
    sheet = lay_out(
        figure,
        small_print(
            name, target, copies, is_dark_on_light=is_dark_on_light, target_file=target_file.name, scale=factors
        ),
        _code(mapping, options, remarks),
        options.paper_mm,
        is_dark_on_light=is_dark_on_light,
        scale=factors,
    )
    remarks += _about(sheet, scale, target, copies)
    title = plain_letters(f"{name}: {described(target, copies)}, circlepose {__version__}")
    documents = _documents(sheet, form, path, title)
    _check_places([*documents, target_file], source, target_file, options)
    for place, content in documents.items():
        with atomic_writer(place, binary=True, overwrite=options.overwrite) as handle:
            handle.write(content)
    comments = _comments(name, [place.name for place in documents], target, drawn, copies)
    with atomic_writer(target_file, overwrite=options.overwrite) as text:
        text.write("".join(f"{line}\n" for line in (COMMENT, *(f"# {line}" for line in comments))))
        text.write(mapping)
    return Printed(tuple(documents), target_file, target, len(sheet.pages), tuple(remarks))


def _in_lines(mapping: Mapping[str, object]) -> str:
    """Return YAML with a line for each key, and for each part of a list of mappings."""
    lines = []
    for key, value in mapping.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            lines += [f"{key}:", *(f"- {_in_line(part)}" for part in value)]
        else:
            lines.append(f"{key}: {_in_line(value)}")
    return "".join(f"{line}\n" for line in lines)


def _in_line(value: object) -> str:
    # A lone value would be followed by the end of a document.
    return yaml.safe_dump([value], default_flow_style=True, sort_keys=False, width=math.inf).strip()[1:-1]


def _form_of(path: Path) -> Form:
    suffix = path.suffix.lower().removeprefix(".")
    if suffix not in FORMS:
        raise UsageError(f"{path}: expected a name that ends in .svg, .pdf or .dxf.")
    return suffix


def _as_printed(drawn: Target, options: PrintOptions, remarks: list[str]) -> Target:
    """Return the target that the sheet will be: with its polarity, its count, marks and the side that is seen."""
    is_dark_on_light = options.is_dark_on_light
    if is_dark_on_light is None:
        is_dark_on_light = drawn.polarity != "bright"
    target = replace(drawn, polarity="dark" if is_dark_on_light else "bright")
    if options.copies is not None and target.layout is None:
        target = replace(target, count=options.copies)
    elif options.copies is not None:
        raise UsageError("--copies: is of discs and rings; a sheet has one board, print it as often as needed.")
    layout = target.layout
    if layout is None:
        return target
    if layout.is_planar and is_roll_ambiguous(layout):
        settled = with_roll_settled(layout) if options.marks else layout
        if settled is layout:
            remarks.append(
                "a turn maps the board on itself, so no image tells which way up it is (flag roll_ambiguous)"
                + ("" if not options.marks else "; its own marks do not settle it")
            )
        else:
            (mark,) = [new.name for new, old in zip(settled.circles, layout.circles, strict=True) if new != old]
            remarks.append(
                f"{mark} is smaller than the others: a mark that settles the roll; --no-marks leaves it out"
            )
        layout = settled
    if layout.grid is None and layout.side == "auto":
        layout = replace(layout, side="front")
    return replace(target, layout=layout, radii_mm=layout.radii_mm)


def _code(mapping: str, options: PrintOptions, remarks: list[str]) -> Code | None:
    if not options.code:
        return None
    if not has_segno():
        remarks.append("no QR code: it needs segno; run: pip install 'circlepose[print]'")
        return None
    size = len(mapping.encode())
    if size > MOST_BYTES:
        remarks.append(f"no QR code: the target has {size} bytes, and a code that is read well holds {MOST_BYTES}")
        return None
    return code_of(mapping)


def _about(sheet: Sheet, scale: PrintScale | None, target: Target, copies: int) -> list[str]:
    """Return what a person should know of a sheet."""
    remarks = []
    if target.count is None and target.layout is None:
        remarks.append(f"count: all says no number, so the sheet has {copies}; --copies N draws more")
    if scale is not None:
        remarks.append(
            f"print_scale: drawn {1.0 / scale.x:.6g} in x and {1.0 / scale.y:.6g} in y times as long, so that the "
            "same printer, with the paper as before, makes it true"
        )
    if sheet.cut:
        shown = ", ".join(sheet.cut[:4]) + (", ..." if len(sheet.cut) > 4 else "")
        remarks.append(
            f"seams run through {_circles(len(sheet.cut))} ({shown}), no truer than you join the sheets; "
            "a larger paper avoids it"
        )
    return remarks


def _circles(number: int) -> str:
    return "1 circle" if number == 1 else f"{number} circles"


def _documents(sheet: Sheet, form: Form, path: Path, title: str) -> dict[Path, bytes]:
    """Return the content of each file of a sheet."""
    pages: Sequence[Page] = sheet.pages
    if form == "pdf":
        return {path: with_plot_mark(pdf_of(pages, title))}
    if form == "dxf":
        if len(pages) > 1:
            raise UsageError(
                f"{path}: a DXF is one drawing, which takes {len(pages)} sheets of this paper; leave --paper out."
            )
        return {path: with_plot_mark(dxf_of(pages[0]))}
    if len(pages) == 1:
        return {path: with_plot_mark(svg_of(pages[0], title))}
    return {
        path.with_name(f"{path.stem}-{i}{path.suffix}"): with_plot_mark(svg_of(page, title))
        for i, page in enumerate(pages, 1)
    }


def _check_places(places: Sequence[Path], source: Path | None, target_file: Path, options: PrintOptions) -> None:
    """Refuse, before anything is written, what must not be replaced."""
    Outputs(places).refuse(source, "the target")
    for place in places:
        if place.is_dir():
            raise OutputError(f"{place}: is a folder; give the name of a file.")
        refuse_foreign(place, overwrite=options.overwrite)
    if not options.overwrite and _has_measured_scale(target_file):
        raise OutputError(
            f"{target_file}: holds the print_scale of a sheet that was measured; give another name, or --overwrite "
            "to replace it."
        )


def _has_measured_scale(path: Path) -> bool:
    try:
        is_ours = path.is_file() and 0 < path.stat().st_size < _LARGEST_FILE and bears_mark(path)
        return is_ours and read_drawn_target(path)[1] is not None
    except (CircleposeError, OSError):
        # One that cannot be read is no target of ours that is in use.
        return False


def _comments(name: str, sheets: list[str], target: Target, drawn: Target, copies: int) -> list[str]:
    """Return the lines above the target beside a sheet."""
    where = sheets[0] if len(sheets) == 1 else f"{sheets[0]} to {sheets[-1]}"
    lines = [f"{name} as it is printed on {where}: {described(target, copies)}.", *names_words(target, drawn.layout)]
    return [printable(line) for line in lines] + [
        "Print at 100 %, measure both bars, and state measured / stated here where they differ, without the #:",
        "print_scale: {x: 1.000, y: 1.000}",
    ]

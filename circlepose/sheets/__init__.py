"""Targets as sheets in true size: shapes in mm, the pages they are printed on, and SVG, PDF and DXF of these."""

from typing import Literal, get_args

Form = Literal["svg", "pdf", "dxf"]
FORMS: tuple[Form, ...] = get_args(Form)

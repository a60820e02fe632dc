"""Results as tables, and tables read back."""

from typing import Literal, get_args

Layout = Literal["poses", "table1", "table2"]
LAYOUTS: tuple[Layout, ...] = get_args(Layout)
"""Names of the layouts, as on the command line."""

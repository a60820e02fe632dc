"""Results as tables, and tables read back."""

from typing import Literal, get_args

DataLayout = Literal["poses", "boards", "pairs"]
Layout = Literal["poses", "boards", "pairs", "table1", "table2"]
DATA_LAYOUTS: tuple[DataLayout, ...] = get_args(DataLayout)
"""Names of our own layouts, which have columns to choose from."""
LAYOUTS: tuple[Layout, ...] = get_args(Layout)
"""Names of the layouts, as on the command line."""

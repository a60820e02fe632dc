"""Where the results go: standard output, or a file with, as long as a run is not at its end, a journal beside it.

What is to be at a URL stands in a folder of this machine until it is whole, and so does its journal.
"""

from __future__ import annotations

import os
import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TextIO

from circlepose.batch.journal import Journal
from circlepose.batch.local import MeasureOptions
from circlepose.batch.resume import conditions, journal_path
from circlepose.errors import UsageError
from circlepose.files.atomic import atomic_writer
from circlepose.files.remote import Place, RemoteFile
from circlepose.files.remote_output import stand_in, uploading_writer


def open_journal(output: Place | None, options: MeasureOptions, *, resume: bool) -> Journal | None:
    """Open the journal of `output`; None where that is no regular file, which cannot be gone on with.

    Raises `UsageError` for a run that cannot be resumed.
    """
    if output is None:
        if resume:
            raise UsageError("--resume: needs -o FILE, beside which is kept what is finished.")
        return None
    if isinstance(output, RemoteFile):
        return Journal(journal_path(stand_in(output)), conditions(options), resume=resume, output=str(output))
    place = Path(os.path.realpath(output))
    if os.path.exists(place) and not os.path.isfile(place):  # noqa: PTH110, PTH113 - never raise
        if resume:
            raise UsageError(f"--resume: {output} is no regular file, so nothing is kept beside it.")
        return None
    return Journal(journal_path(place), conditions(options), resume=resume, output=str(output))


def open_output(output: Place | None, journal: Journal | None) -> AbstractContextManager[TextIO]:
    """Open `output`, which appears when it is complete, or standard output."""
    if isinstance(output, RemoteFile):
        return uploading_writer(output, journal_path(stand_in(output)).with_suffix(".part"))
    if output is not None:
        # The journal's lock keeps the name for this run; what a killed one left there is overwritten.
        return atomic_writer(output, temporary=None if journal is None else journal.path.with_suffix(".part"))
    return nullcontext(sys.stdout)

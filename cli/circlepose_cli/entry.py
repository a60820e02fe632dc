"""The command `circlepose` as a process: signals are handled from here on, before all else is imported."""

from __future__ import annotations

import sys

from circlepose_cli.console import interruption


def main() -> int:
    """Run the command line of the process and return the exit code."""
    interruption.handle_signals()
    try:
        from circlepose_cli.app import main as run  # noqa: PLC0415 - takes a tenth of a second
    except ImportError as error:
        from circlepose_cli.console.installation import broken_package  # noqa: PLC0415 - rarely needed

        message = broken_package(error)
        if message is None:
            raise
        print(f"circlepose: {message}", file=sys.stderr)
        code = 2
    else:
        code = run()
    # All is done: a signal now would only hide the exit code.
    interruption.ignore_signals()
    return code


if __name__ == "__main__":
    sys.exit(main())

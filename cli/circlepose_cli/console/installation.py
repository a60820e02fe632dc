"""What to do where a package that circlepose needs cannot be used."""

from __future__ import annotations

import sys
from types import ModuleType

_OPENCV_PACKAGES = (
    "opencv-python",
    "opencv-contrib-python",
    "opencv-python-headless",
    "opencv-contrib-python-headless",
)
_NEEDED = {
    "cv2": "opencv-python-headless",
    "numpy": "numpy",
    "scipy": "scipy",
    "typer": "typer",
    "rich": "rich",
    "yaml": "pyyaml",
    "pydantic": "pydantic",
    "pydantic_core": "pydantic",
}
"""modules that circlepose imports, and the packages that bring them"""
_NO_MEMORY = ("failed to map segment", "cannot allocate memory")
"""of the dynamic loader's messages"""


def broken_package(error: Exception) -> str | None:
    """Return a sentence on the package whose failed import `error` is, or None where it is something else."""
    module = _module_of(error)
    if module is None:
        return None
    if any(words in str(error).lower() for words in _NO_MEMORY):
        return f"memory does not suffice to load the module {module} ({_reason(error)}); allow more (ulimit -v)."
    installed = _installed() if module == "cv2" else []
    if len(installed) > 1:
        return (
            f"the module cv2 cannot be used ({_reason(error)}): the packages {' and '.join(installed)} overwrite "
            f"each other's files. Keep one: {_pip()} uninstall -y {' '.join(installed)}, then "
            f"{_pip()} install opencv-python-headless."
        )
    package = installed[0] if installed else _NEEDED[module]
    return (
        f"the module {module} cannot be used ({_reason(error)}). Install it again: "
        f"{_pip()} install --force-reinstall {package}."
    )


def _module_of(error: Exception) -> str | None:
    """Return the name, in `_NEEDED`, of the module that cannot be imported or lacks what it should have."""
    if isinstance(error, ImportError):
        names = [error.name or "", *_frames_modules(error)]
    elif isinstance(error, AttributeError) and isinstance(error.obj, ModuleType):
        names = [error.obj.__name__]
    else:
        return None
    tops = (name.partition(".")[0].lstrip("_") for name in names)
    return next((top for top in tops if top in _NEEDED), None)


def _frames_modules(error: Exception) -> list[str]:
    """Return the names of the modules that were at work when `error` was raised, the innermost first."""
    names = []
    trace = error.__traceback__
    while trace is not None:
        names.append(str(trace.tb_frame.f_globals.get("__name__", "")))
        trace = trace.tb_next
    return names[::-1]


def _installed() -> list[str]:
    from importlib import metadata  # noqa: PLC0415 - a fifth of the time to start

    found = []
    for package in _OPENCV_PACKAGES:
        try:
            metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
        found.append(package)
    return found


def _reason(error: Exception) -> str:
    return str(error).strip().split("\n")[0].rstrip(".") or type(error).__name__


def _pip() -> str:
    return f"{sys.executable or 'python'} -m pip"

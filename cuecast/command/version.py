"""The version of the installed distribution, known from one place."""

from importlib.metadata import PackageNotFoundError, version


def installed_version() -> str:
    """Return the version of the distribution; ``0+checkout`` where it is run uninstalled."""
    try:
        return version("cuecast")
    except PackageNotFoundError:
        return "0+checkout"

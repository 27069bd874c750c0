"""The version of the installed distribution, known from one place."""


def installed_version() -> str:
    """Return the version of the distribution; ``0+checkout`` where it is run uninstalled."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("cuecast")
    except PackageNotFoundError:
        return "0+checkout"

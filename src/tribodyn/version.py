"""The version of this program and of the packages that it uses, as they are installed."""

from functools import cache
from importlib.metadata import PackageNotFoundError, version


@cache  # a study asks for the same ones in every run
def package_version(name: str) -> str:
    """Version of an installed package; a source tree that is run without being installed has none."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


__version__ = package_version("tribodyn")

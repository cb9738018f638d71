"""Where the packages are: in src/tribodyn, whose links lead to the folders at the top, or in these themselves.

Git leaves links as text files where core.symlinks is false, as on Windows. All else is in pyproject.toml."""

from pathlib import Path

from setuptools import find_packages, setup

ROOMS = ("geometry", "fem", "reduction", "hbm", "workflows")
FOLDERS = {} if Path("src/tribodyn/fem").is_dir() else {f"tribodyn.{room}": room for room in ROOMS}
PACKAGES = [*FOLDERS, *(f"{name}.{inner}" for name, folder in FOLDERS.items() for inner in find_packages(folder))]

setup(packages=[*find_packages("src"), *PACKAGES], package_dir={"": "src", **FOLDERS})

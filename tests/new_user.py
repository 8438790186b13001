"""Stand for a new user: `python tests/new_user.py` does what README.md says first, in an environment of its own.

The tree as it is committed, a fresh virtual environment, the run command of README.md and nothing else.  Then the page
is opened in headless Chromium, where there is one: its slider must move the picture.  Prints what each part took and
the installed size.  It takes minutes and asks the package index, so it is no test of the suite.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NOT_OURS = ("pip", "setuptools", "pkg_resources", "_distutils_hack")  # of every environment


def run_command() -> str:
    """The command that README.md names first."""
    found = re.search(r"<!-- run command -->\n```\n(.*?)\n```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S)
    if found is None:
        raise SystemExit("README.md names no run command")
    return found[1]


def size_of(folder: Path) -> float:
    """Bytes on disk of what was installed, in MB, without what every environment has."""
    return sum(f.stat().st_blocks * 512 for f in folder.rglob("*") if f.is_file()
               and not f.relative_to(folder).parts[0].startswith(NOT_OURS)) / 1e6


def main() -> None:
    """Do it."""
    work = Path(tempfile.mkdtemp(prefix="slideline-new-user-"))
    try:
        tree = work / "slideline"
        subprocess.run(["git", "clone", "-q", "--depth", "1", f"file://{ROOT}", str(tree)], check=True)
        subprocess.run([sys.executable, "-m", "venv", str(work / "venv")], check=True)
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "SLIDELINE", "NUMBA"))}
        environment |= {"PATH": f"{work / 'venv/bin'}:{environment['PATH']}", "HOME": str(work),
                        "VIRTUAL_ENV": str(work / "venv")}
        for command in run_command().split(" && "):
            start = time.monotonic()
            subprocess.run(command, shell=True, cwd=tree, env=environment, check=True, timeout=900)
            print(f"{time.monotonic() - start:6.0f} s  {command}", flush=True)
        for packages in (work / "venv/lib").glob("python*/site-packages"):
            print(f"{size_of(packages):6.0f} MB installed")
        page = tree / "run.html"
        print(f"{page.stat().st_size / 1e6:6.2f} MB  {page.name}")
        look(page)
    finally:
        shutil.rmtree(work)


def look(page: Path) -> None:
    """Open the page and move its slider.  Raises AssertionError where the picture stays, or the console has errors."""
    sys.path.insert(0, str(ROOT / "tests/coupler"))
    from browser import CHROMIUM, Browser
    from test_live import PIXELS, SLIDE

    if not CHROMIUM:
        print("no Chromium: the page was not looked at")
        return
    with tempfile.TemporaryDirectory() as profile, Browser(Path(profile)) as browser:
        browser.open(page)
        before = browser.value(PIXELS)
        browser.value(SLIDE % 10)
        assert browser.value(PIXELS) != before, "the slider does not move the picture"
        assert browser.troubles == []
    print("the slider moves the picture; nothing on the console")


if __name__ == "__main__":
    main()

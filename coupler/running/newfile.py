"""Files that a command makes for its user: never over another, all of them or none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

from coupler.errors import ScenarioError

ANOTHER = "Give another one with --out"


def check_free(out: Path) -> None:
    """Raises ScenarioError where a file stands already, or its folder does not exist."""
    # fault: init: a file that is there is written over -> if False: | coupler/test_init
    if out.exists() or out.is_symlink():
        raise ScenarioError("this file is there already; it is left as it is", file=str(out), remedy=ANOTHER)
    if not out.parent.is_dir():
        raise ScenarioError("the folder of this file does not exist", file=str(out),
                            remedy=f"Make it: mkdir -p {out.parent}")


@contextmanager
def new_files(texts: Mapping[Path, str]) -> Iterator[None]:
    """Write them; they are taken away again where one cannot be written, or where the block they are made for raises.

    Raises ScenarioError.
    """
    with ExitStack() as stack:
        for path, text in texts.items():
            try:
                # x: a file that came between the look and the writing is left alone too.
                with path.open("x", encoding="utf-8") as file:
                    # fault: new files: what was written stays where the check fails -> pass | coupler/test_deck
                    stack.callback(path.unlink, missing_ok=True)
                    file.write(text)
            except OSError as exc:
                raise ScenarioError(f"this file cannot be written ({exc.strerror})", file=str(path),
                                    remedy=ANOTHER) from exc
        yield
        stack.pop_all()

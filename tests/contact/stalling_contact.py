"""The real contact service, which goes to sleep in the middle of a chosen Traction and says so by making a file.

python stalling_contact.py NUMBER FILE ... : the rest as contact.rpc.serve.  NUMBER counts from 1; 0: never.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from unittest.mock import patch

from contact import traction
from contact.service import ContactService


def stall(number: int, flag: Path) -> None:
    """Serve; the forces of Traction `number` are found, their blocks not yet added up, when it stalls."""
    calls = 0
    added_up = traction.added_up

    def slow(*given):
        nonlocal calls
        calls += 1
        if calls == number:
            flag.touch()
            time.sleep(60.0)
        return added_up(*given)

    from contact.rpc.serve import main

    with patch.object(traction, "added_up", slow):
        sys.exit(main(ContactService().handle, sys.argv[3:]))


if __name__ == "__main__":
    stall(int(sys.argv[1]), Path(sys.argv[2]))

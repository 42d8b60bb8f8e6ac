"""Run magbend with its control sockets in another folder: FOLDER WORDS..."""

from __future__ import annotations

import sys
from pathlib import Path

from magbend.cli.main import main
from magbend.rig.control import names

if __name__ == "__main__":
    names._SYSTEM_TEMP = Path(sys.argv.pop(1))
    main()

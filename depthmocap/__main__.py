"""`python -m depthmocap`: the command `depthmocap`."""

from __future__ import annotations

from toolkit.app.cli.main import main

if __name__ == "__main__":
    main()

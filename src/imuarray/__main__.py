"""The commands, as ``python -m imuarray``."""

import sys

from imuarray.cli import main

sys.exit(main())

"""``python -m cablesim``."""

from cablesim.cli import main

main()

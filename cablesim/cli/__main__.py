"""``python -m cablesim.cli``."""

from cablesim.cli import main

main()

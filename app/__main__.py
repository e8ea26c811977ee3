"""`python -m app` is the same as `airside`."""

from app.cli import main

main()

"""`python -m coupler.cli`: the command line where no console script is installed."""

from coupler.cli.cli import start

if __name__ == "__main__":
    start()

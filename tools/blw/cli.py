# SPDX-License-Identifier: MIT
"""The command line: a dispatcher.  Every command lives in its own module."""

import importlib
import sys
from collections.abc import Sequence

import click

import blw
from blw.errors import BulwarkError

# Command -> module and click command in it.  Loaded when used, so that `design` does not wait for
# the libraries of `report`.  A new command is one line here.
COMMANDS = {
    "demo": "blw.demo:demo",
    "analyze": "blw.analyze_command:analyze",
    "design": "blw.design_command:design",
    "run": "blw.simulate:run",
    "replay": "blw.simulate:replay",
    "plant": "blw.bus:plant",
    "node": "blw.bus:node",
    "attack": "blw.bus:attack",
    "report": "blw.report.command:report",
    "export": "blw.logs.export:export",
    "recorded": "blw.recorded:recorded",
    "import": "blw.importer:import_",
    "joint": "blw.joint_command:joint_group",
    "bench": "blw.cost.command:bench",
    "size": "blw.cost.command:size",
    "amalgamate": "blw.amalgamate:amalgamate",
    "doctor": "blw.doctor:doctor",
    "test": "blw.testing:test",
}

USAGE_ERROR = 2


class LazyGroup(click.Group):
    """Commands from COMMANDS."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, attribute = COMMANDS[cmd_name].split(":")
        return getattr(importlib.import_module(module), attribute)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(blw.__version__, prog_name="bulwark")
def bulwark() -> None:
    """Secure state estimation: design, simulate and analyse estimators that survive attacks."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status: 0 success, 1 failed run, 2 usage or bad input."""
    try:
        status = bulwark.main(arguments, prog_name="bulwark", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return USAGE_ERROR
    except click.ClickException as error:
        return _refuse(error.format_message(), error.exit_code)
    except BulwarkError as error:
        return _refuse(str(error))
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _refuse(f"{where}{error.strerror or error}")
    except (click.Abort, KeyboardInterrupt):
        click.echo("bulwark: interrupted", err=True)
        return 130
    return status if isinstance(status, int) else 0


def _refuse(message: str, status: int = USAGE_ERROR) -> int:
    click.echo("bulwark: " + " ".join(message.split()), err=True)
    return status

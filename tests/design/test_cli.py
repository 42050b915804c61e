# SPDX-License-Identifier: MIT
"""The dispatcher: exit statuses and one-line messages."""

import importlib

import click
import pytest

from blw import cli
from blw.errors import BulwarkError


def test_main_given_help_lists_every_command(capsys):
    assert cli.main(["--help"]) == 0
    text = capsys.readouterr().out
    for command in cli.COMMANDS:
        assert f"  {command} " in text


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_main_given_help_of_a_command_shows_its_usage(command, capsys):
    assert cli.main([command, "--help"]) == 0
    assert f"Usage: bulwark {command}" in capsys.readouterr().out


def test_main_given_version_prints_it(capsys):
    assert cli.main(["--version"]) == 0
    assert "bulwark" in capsys.readouterr().out


@pytest.mark.parametrize("arguments, message", [
    (["desing"], "No such command 'desing'"),
    (["--nonsense"], "No such option"),
    (["design"], "Missing argument 'MODEL'"),
    (["design", "m.toml"], "Missing option '--out'"),
    (["design", "nowhere.toml", "--out", "out"], "nowhere.toml: No such file"),
])
def test_main_given_wrong_usage_says_so_in_one_line(arguments, message, capsys, tmp_path,
                                                    monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == 2
    err = capsys.readouterr().err
    assert err.startswith("bulwark: ") and err.count("\n") == 1
    assert message in err
    assert not list(tmp_path.iterdir())


def test_main_given_nothing_shows_the_help_and_fails(capsys):
    assert cli.main([]) == 2
    assert "Commands:" in capsys.readouterr().err


@pytest.mark.parametrize("error, status, message", [
    (BulwarkError("file: what\nand where"), 2, "bulwark: file: what and where\n"),
    (click.ClickException("the build failed"), 1, "bulwark: the build failed\n"),
    (PermissionError(13, "Permission denied", "/x"), 2, "bulwark: /x: Permission denied\n"),
    (KeyboardInterrupt(), 130, "bulwark: interrupted\n"),
])
def test_main_given_failing_command_maps_the_error_to_a_status(error, status, message, capsys,
                                                              monkeypatch):
    @click.command()
    def failing():
        raise error

    module = importlib.import_module("blw.design_command")
    monkeypatch.setattr(module, "design", failing)
    assert cli.main(["design"]) == status
    assert capsys.readouterr().err.endswith(message)


def test_main_given_command_that_returns_a_status_passes_it_on(monkeypatch):
    module = importlib.import_module("blw.design_command")
    monkeypatch.setattr(module, "design", click.command()(lambda: 1))
    assert cli.main(["design"]) == 1

"""Rules of all commands: groups, JSON, quiet, exit codes, messages, completion, former options."""

import argparse
import json
import re
import signal
import subprocess
import sys
from collections import defaultdict
from importlib import import_module

import pytest

from turnout import __version__
from turnout.cli import COMMANDS, GROUPS
from turnout.cli.completion import words_by_path
from turnout.cli.main import EXIT_CODES, build_parser, main
from turnout.cli.options import leaf_parsers
from turnout.errors import ConfigError
from turnout.workflow.launch import launch

PARSER = build_parser()
SEVERAL_KINDS = {  # options whose values differ between commands, and why
    "--only": "what is shown or made: a word, names of tables, kinds of effects",
    "--out": "blind score pools several sets",
    "--seed": "blind make also accepts 'tool'",
    "--histories": "their number when they are made, afterwards whether the set has them",
    "--passages": "the demonstration checks their number itself",
}
NO_PLURALS = {  # options that differ by an s, with another meaning
    ("--name", "--names"),  # of a layout or turnout; file of names that are right
    ("--campaign", "--campaigns"),  # day of a campaign; number of campaigns
    ("--effect", "--effects"),  # what maintenance did; causes that a diagnosis can name
    ("--format", "--formats"),  # of the output; list of them
    ("--page", "--pages"),  # a page of the documentation; folder of the pages
}


@pytest.fixture
def project(tmp_path, repository, monkeypatch):
    """A working folder with the configuration of the demonstration."""
    (tmp_path / "config").symlink_to(repository / "config")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_version(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0 and capsys.readouterr().out == f"turnout {__version__}\n"


def test_help_lists_each_command_once_in_its_group():
    text = PARSER.format_help()
    for name in COMMANDS:
        assert import_module(f"turnout.cli.{name}").GROUP in GROUPS, f"give turnout.cli.{name} a GROUP"
        assert len(re.findall(rf"^  {name} +\S", text, re.M)) == 1, name
    assert EXIT_CODES in text


@pytest.mark.parametrize("leaf", [*leaf_parsers(PARSER)], ids=lambda leaf: leaf.prog)
def test_the_usage_of_a_command_begins_with_the_words_that_a_user_types(leaf):
    assert leaf.format_usage().startswith(f"usage: {leaf.prog}") and re.match(r"turnout [a-z-]+( [a-z-]+)?$", leaf.prog)


@pytest.mark.parametrize("leaf", [*leaf_parsers(PARSER)], ids=lambda leaf: leaf.prog)
def test_every_command_and_action_has_the_common_options(leaf):
    assert {"--json", "-q", "--quiet", "-v", "--verbose"} <= set(leaf._option_string_actions)


def test_json_is_one_object_with_result_text_and_exit_code(project, capsys):
    assert main(["events", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["command"], printed["exit_code"], printed["error"]) == ("events", 0, None)
    assert len(printed["result"]) == len(printed["text"]) == 3 and printed["result"][0]["kind"] in printed["text"][0]


def test_json_of_an_error(project, capsys):
    assert main(["config", "show", "tommerup_s9", "--json"]) == 2
    printed = json.loads(capsys.readouterr().out)
    assert printed["exit_code"] == 2 and "no turnout 'tommerup_s9'" in printed["error"] and printed["result"] is None


def test_the_json_object_contains_no_output_of_other_programs():
    """The output of a subprocess goes to standard error."""
    code = (
        "import subprocess, types, turnout.cli.init as command\n"
        "command.run = lambda args: subprocess.run(['echo', 'from elsewhere']).returncode\n"
        "from turnout.cli.main import main; main(['init', 'x', '--json'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["exit_code"] == 0 and "from elsewhere" in done.stderr


def raising(error):
    def run(args):
        raise error

    return run


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (ConfigError("plan", "number", "none", "Write one"), 2, "turnout plan: number: none. Write one.\n"),
        (ConfigError("planned.csv", "line 1", "none", "Write one"), 2, "turnout plan: planned.csv, line 1: none."),
        (FileNotFoundError(2, "No such file", "a.h5"), 2, "turnout plan: a.h5: No such file. Correct this"),
        (ZeroDivisionError("of the program"), 3, "turnout plan: a fault of the program, ZeroDivisionError"),
        (KeyboardInterrupt(), 130, "turnout plan: interrupted"),
    ],
)
def test_exit_codes_are_right_and_messages_repeat_no_prefix(monkeypatch, capsys, error, code, message):
    monkeypatch.setattr("turnout.cli.plan.run", raising(error))
    assert main(["plan"]) == code
    assert message in capsys.readouterr().err


def test_verbose_output_has_the_exit_code_and_the_traceback_of_an_error(monkeypatch, capsys):
    monkeypatch.setattr("turnout.cli.plan.run", raising(ConfigError("a.yaml", "line 1", "wrong", "Change it")))
    main(["plan", "-v"])
    message = capsys.readouterr().err
    assert "Traceback" in message and "turnout plan: exit code 2 after" in message


def test_a_wrong_id_gives_the_message_that_the_workflow_gives(project, capsys):
    assert main(["config", "show", "tommerup_s9"]) == 2
    with pytest.raises(ConfigError) as error:
        launch({"turnouts": "tommerup_s9"}, scan=False)
    assert capsys.readouterr().err == f"turnout config: {error.value}\n"


@pytest.mark.parametrize(
    ("line", "former", "present", "expected"),
    [
        ("simulate hammer --section A7 --blows 3", "--blows", "--impacts", 3),
        ("distinguish --sensor-positions 1 --blows 3 4", "--blows", "--impact-positions", [3.0, 4.0]),
        ("distinguish --sensors 1", "--sensors", "--sensor-positions", [1.0]),  # stands for a required option
        ("distinguish --sensor-positions 1 --trains ic3", "--trains", "--vehicles", ["ic3"]),
        ("worklist --asof 2026-03-01", "--asof", "--as-of", "2026-03-01"),
        ("compare a.h5 --turnout t1 --out a.html", "--out", "--figure", "a.html"),
        ("passage a.h5 --turnout t1 --out a.html", "--out", "--figure", "a.html"),
        ("paper t1 --bars a.html", "--bars", "--figure", "a.html"),
        ("diagnose --turnout t1 --budget 10", "--budget", "--limit-minutes", 10.0),
        ("blind make --out a --workers 2", "--workers", "--cores", 2),
    ],
)
def test_a_former_option_works_with_a_warning(capsys, line, former, present, expected):
    assert getattr(build_parser().parse_args(line.split()), present[2:].replace("-", "_")) == expected
    assert f"{former} is called {present} now" in capsys.readouterr().err
    paths = [path for path in words_by_path(PARSER) if f" {line} ".startswith(f"{path} ")]
    words = words_by_path(PARSER)[max(paths, key=len)]
    assert former not in words and present in words


def options_of_commands():
    """(option, command, its definition) of every option that the help shows."""
    return [
        (option, leaf.prog, action)
        for leaf in leaf_parsers(PARSER)
        for action in leaf._actions
        if action.help != argparse.SUPPRESS
        for option in action.option_strings
        if option.startswith("--")
    ]


def takes(action):
    """Kind of the values of an option: none, one or several, and their type."""
    several = action.nargs in ("*", "+") or isinstance(action, argparse._AppendAction | argparse._ExtendAction)
    return ("none" if action.nargs == 0 else "several" if several else "one", action.type)


def test_an_option_has_one_spelling_and_takes_the_same_values_in_every_command():
    spellings, kinds = defaultdict(set), defaultdict(lambda: defaultdict(set))
    for option, command, action in options_of_commands():
        spellings[option.replace("-", "")].add(option)
        kinds[option][takes(action)].add(command)
    assert not [names for names in spellings.values() if len(names) > 1]
    different = {option: dict(found) for option, found in kinds.items() if len(found) > 1}
    assert different.keys() == SEVERAL_KINDS.keys(), different


def test_an_option_of_several_values_is_a_plural_and_one_of_a_single_value_is_not():
    """``--turnout`` names one turnout, ``--turnouts`` several."""
    options = {option: takes(action)[0] for option, _, action in options_of_commands()}
    pairs = [(option, f"{option}s") for option in options if f"{option}s" in options]
    assert ("--turnout", "--turnouts") in pairs and ("--section", "--sections") in pairs
    wrong = [pair for pair in pairs if options[pair[0]] != "one" or options[pair[1]] != "several"]
    assert not [pair for pair in wrong if pair not in NO_PLURALS]


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        (["wor"], {"worklist"}),
        (["simulate", "pass"], {"passage"}),
        (["simulate", "hammer", "--imp"], {"--impacts"}),
        (["query", "--re"], {"--registry"}),
    ],
)
def test_bash_completes(tmp_path, capsys, typed, expected):
    main(["completion", "bash"])
    script = tmp_path / "completion"
    script.write_text(capsys.readouterr().out)
    words = " ".join(["turnout", *typed])
    ask = f'. {script}; COMP_WORDS=({words}); COMP_CWORD={len(typed)}; _turnout; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == expected


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_the_completion_of_other_shells_has_every_command(capsys, shell):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(name in script for name in COMMANDS)


@pytest.mark.parametrize(
    "body",
    [
        "raise KeyboardInterrupt",
        "try: os.kill(os.getpid(), 2); time.sleep(5)\n    except KeyboardInterrupt: raise RuntimeError('ended')",
    ],
)
def test_an_interrupt_that_a_library_converts_is_not_reported_as_a_fault_of_the_program(body):
    """DuckDB converts the interrupt to a RuntimeError of its own."""
    code = f"import os, signal, sys, time, turnout.cli.plan as command\ndef run(args):\n    {body}\ncommand.run = run\n"
    code += "signal.signal(2, signal.default_int_handler)\n"  # a process in the background ignores interrupts
    code += "from turnout.cli.main import main; sys.exit(main(['plan']))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "turnout plan: interrupted\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_open_contexts_in_order_and_its_number_is_in_the_exit_code(tmp_path, number):
    """So an unfinished file of any command is removed."""
    code = (
        "import os, signal, sys, time, turnout.cli.plan as command\n"
        "from turnout.files import write_atomic\n"
        "signal.signal(1, signal.SIG_DFL)\n"  # ignored below nohup
        "signal.signal(2, signal.default_int_handler)\n"  # ignored in the background
        f"def slow(stream):\n    os.kill(os.getpid(), {int(number)}); time.sleep(5)\n"
        f"command.run = lambda args: write_atomic({str(tmp_path / 'page.html')!r}, slow)\n"
        "from turnout.cli.main import main; sys.exit(main(['plan']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (128 + number, "turnout plan: interrupted\n")
    assert not list(tmp_path.iterdir())


def test_an_interrupt_before_the_command_begins_is_not_reported_as_a_fault_of_the_program(monkeypatch, capsys):
    monkeypatch.setattr("turnout.cli.main.build_parser", lambda: raising(KeyboardInterrupt())(None))
    assert main(["plan"]) == 130 and capsys.readouterr().err == "turnout: interrupted\n"

"""Print the completion script of a shell for commands and options.

  bash   turnout completion bash > ~/.local/share/bash-completion/completions/turnout
  zsh    turnout completion zsh > ~/.zfunc/_turnout      (a folder of $fpath)
  fish   turnout completion fish > ~/.config/fish/completions/turnout.fish

Other words are completed as names of files.
"""

from __future__ import annotations

import argparse

GROUP = "Set up"
HELP = "print the completion of commands and options for a shell"
BASH = """\
_turnout() {{
    local current="${{COMP_WORDS[COMP_CWORD]}}" words="" path="" word
    for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
        case "$path $word" in
            {paths}) path="$path $word" ;;
        esac
    done
    case "$path" in
{cases}
    esac
    COMPREPLY=($(compgen -W "$words" -- "$current"))
}}
complete -o default -F _turnout turnout
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The shell.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("shell", choices=("bash", "zsh", "fish"))


def run(args: argparse.Namespace) -> int:
    """Print the script.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from turnout.cli.main import build_parser

    words = words_by_path(build_parser())
    print(_fish(words) if args.shell == "fish" else _bash(words, args.shell == "zsh"), end="")
    return 0


def words_by_path(parser: argparse.ArgumentParser, path: str = "") -> dict[str, list[str]]:
    """The words that may follow a command: its actions and options.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the program or of a command.
    path : str
        The command, " simulate hammer"; "" for the program.

    Returns
    -------
    dict of str to list of str
        Words by command, those of the actions of a command too.
    """
    words: list[str] = []
    inner: dict[str, list[str]] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            words += action.choices
            for name, sub in action.choices.items():
                inner |= words_by_path(sub, f"{path} {name}")
        elif action.option_strings and action.help != argparse.SUPPRESS:
            words += action.option_strings
        elif action.choices:
            words += map(str, action.choices)
    return {path: words} | inner


def _bash(words: dict[str, list[str]], for_zsh: bool) -> str:
    """Completion for bash, or by its functions in zsh."""
    cases = "\n".join(f'        "{path}") words="{" ".join(w)}" ;;' for path, w in words.items())
    paths = "|".join(f'"{path}"' for path in words if path)
    script = BASH.format(cases=cases, paths=paths)
    head = "#compdef turnout\nautoload -U +X bashcompinit && bashcompinit\n" if for_zsh else ""
    return head + script


def _fish(words: dict[str, list[str]]) -> str:
    """Completion for fish: a line per command."""
    lines = []
    for path, following in words.items():
        seen = " ".join(path.split())
        condition = f"__fish_seen_subcommand_from {seen.split()[-1]}" if seen else "__fish_use_subcommand"
        lines.append(f"complete -c turnout -n '{condition}' -a '{' '.join(following)}'")
    return "\n".join(lines) + "\n"
